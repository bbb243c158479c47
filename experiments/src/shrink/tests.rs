//! Small scenarios made smaller.
