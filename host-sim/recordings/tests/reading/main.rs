//! Samples, rate, losses and notes of a file, or the words of its refusal, by [`harness::read`].

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
