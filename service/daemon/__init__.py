"""The daemon: Zenoh in, the live pose out at once, the estimation in a process of its own."""
