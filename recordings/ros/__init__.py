"""ROS 2 messages and measurements: CDR and JSON, decoded and encoded."""
