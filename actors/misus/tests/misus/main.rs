//! The tests of MISUS as its users meet it, in one program: one is linked faster than five.

mod analysis;
mod explorers;
mod planners;
mod shac;
mod survey;
