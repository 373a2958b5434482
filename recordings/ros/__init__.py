"""ROS 2 messages in CDR and JSON: decoding into measurements, and encoding."""
