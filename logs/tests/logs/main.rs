//! Logs of small simulations, from the outside: written, read, verified, compared, recovered.

mod by_hand;
mod common;
mod comparing;
mod foreign;
mod hostile;
mod python;
mod reading;
mod recovering;
mod schemas;
mod siblings;
mod verifying;
mod viewing;
mod writing;
