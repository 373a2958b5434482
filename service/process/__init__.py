"""What a process needs of its machine: signals, the service manager, and a log of its own."""
