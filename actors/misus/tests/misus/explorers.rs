//! Rovers that plan, carry out and plan anew against their hardware, in the closed loop.

mod diary;
mod loops;
