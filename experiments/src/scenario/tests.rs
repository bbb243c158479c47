//! What the reader of scenarios promises.
