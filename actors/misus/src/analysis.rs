//! Data analysis: from readings of rocks to a model of the field, and from the model to goals.
//!
//! Data flows one way:
//!
//! ```text
//! spectrum ─► features ─► reading ─► exchange ─► rocks ─► mixture ─► objective ─► prioritiser
//!                                   (rows of all          (classes)  (what to    (goals, weights,
//!                                    rovers)                          find out)   combinations)
//! ```
//!
//! Everything here is a pure function or a plain value: no actor, no clock, no message is sent.
//! Rovers that hold equal sets of rows have bit-equal models.

pub mod exchange;
pub mod features;
pub mod goals;
pub mod learned;
pub mod library;
pub mod mixture;
pub mod objective;
pub mod prioritise;
pub mod reading;
pub mod rocks;
pub mod scores;
