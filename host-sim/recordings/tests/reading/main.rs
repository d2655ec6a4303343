//! What is read of a file: its samples, rate and losses, the notes beside them, or the words with which it is refused.
//!
//! Every test goes through [`reading::read`], so that a change of the crate's interface changes that one function.

mod damage;
mod inspection;
mod other_people;
mod other_programs;
mod parts;
mod reading;
mod refusals;
mod streams;
mod tables;
