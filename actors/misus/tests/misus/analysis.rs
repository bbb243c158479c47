//! The data analysis on rock fields: small versions of what the examples measure.

#[path = "../../examples/support/field.rs"]
mod field;

mod distributed;
mod goals;
mod learning;
mod spectra;
