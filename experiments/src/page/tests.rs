//! Pages of logs.
