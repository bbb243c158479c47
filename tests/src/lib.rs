//! What crosses Farside's crates: determinism, replay, properties, the command line.
