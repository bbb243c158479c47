//! Small inputs that once were answered wrongly, each with its right answer. What the inputs are is
//! told in `README.md` of their folder below `tests/cases`.

mod links;
mod logs;
mod maps;
mod network;
