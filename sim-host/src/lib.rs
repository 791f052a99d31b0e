//! Simulated CAN bus and robot in virtual time, and the host side of every bus.
