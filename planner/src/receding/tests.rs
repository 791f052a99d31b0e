//! Horizons of shipped robots.
