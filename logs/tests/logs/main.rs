//! Logs of small simulations, from the outside: written, read, verified, compared, recovered.

mod common;
mod verifying;
mod writing;
