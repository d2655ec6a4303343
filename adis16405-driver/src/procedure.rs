//! What the part can be told to do, as sequences of frames and pauses without I/O in them.

mod alarms;
mod bias;
mod command;
mod pins;
mod settings;
mod sleep;
mod start;
mod test;
