//! The version of the code.

/// The version that logs and results are stamped with.
pub(crate) const CODE_VERSION: &str = env!("CARGO_PKG_VERSION");
