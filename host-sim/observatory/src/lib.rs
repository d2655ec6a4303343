//! Code shared by the command and the page in the browser: from an open recording to its report, and from the messages of a device to text,
//! the live view and the checks of the bench. It opens no file or port, and prints nothing.

pub mod bench;
pub mod latest_messages;
pub mod message_text;
pub mod recording_report;
pub mod streaming;
