"""The daemon: Zenoh in, the live pose out at once, the estimation beside it in a process of its own."""
