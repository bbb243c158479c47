//! What Farside's tests share: models that exercise every part of the kernel's contract, built from
//! a description that proptest can shrink. Nothing depends on this crate.

pub mod chatter;
pub mod executors;
