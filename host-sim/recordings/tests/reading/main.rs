//! The result of reading a file: its samples, rate and losses, the notes beside them, or the words with which it is refused.
//!
//! Every test goes through [`harness::read`], so that a change of the crate's interface changes that one function.

mod damage;
mod harness;
mod inspection;
mod kinds;
mod other_people;
mod other_programs;
mod parts;
mod refusals;
mod streams;
mod tables;
