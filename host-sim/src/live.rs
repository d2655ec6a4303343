//! `monitor` on a terminal: the whole screen shows the latest messages of a device.

use crate::interrupt;
use anyhow::{Context, Result};
use observatory::latest_messages::LatestMessages;
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use recordings::serial::SerialLink;
use reports::live::CurveGroup;
use std::io::{IsTerminal, Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// Time between two drawings.
const FRAME: Duration = Duration::from_millis(100);

/// True if the program has a terminal to draw on and to read keys from.
pub(crate) fn has_terminal() -> bool {
    std::io::stdout().is_terminal() && std::io::stdin().is_terminal()
}

/// True unless the user does not want colour: `NO_COLOR` is not set, or empty.
fn wants_colour() -> bool {
    std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

/// Shows the device on `port`, at the other end of `cable`, on the whole terminal. It ends when the user ends it, when the device hangs up,
/// at `until`, or at an interrupt. The terminal is restored then, and also if the program panics.
///
/// # Errors
/// The port or the terminal fails.
pub(crate) fn show<P: Read + Write>(cable: &mut SerialLink<P>, port: &str, until: Option<Instant>) -> Result<()> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    // In the terminal's raw mode Ctrl-C is a key; this handles a signal from elsewhere.
    interrupt::on_signal(move || {
        flag.store(true, Relaxed);
        true
    });
    let shown = ratatui::try_init()
        .context("terminal")
        .and_then(|mut terminal| draw_until_end(cable, port, &mut terminal, until, &interrupted));
    ratatui::restore();
    shown
}

fn draw_until_end<P: Read + Write>(
    cable: &mut SerialLink<P>,
    port: &str,
    terminal: &mut DefaultTerminal,
    until: Option<Instant>,
    interrupted: &AtomicBool,
) -> Result<()> {
    let in_colour = wants_colour();
    let mut group = CurveGroup::default();
    let (mut messages, mut last_received) = (LatestMessages::new(port.to_owned()), Instant::now());
    loop {
        let view = messages.view(last_received.elapsed(), &cable.counters());
        // The drawing adapts to a changed size of the terminal.
        terminal.draw(|frame| view.draw(frame, group, in_colour))?;
        if interrupted.load(Relaxed) || until.is_some_and(|until| Instant::now() >= until) {
            return Ok(());
        }
        while event::poll(Duration::ZERO)? {
            let Event::Key(key) = event::read()? else { continue };
            if key.kind == KeyEventKind::Release {
                continue;
            }
            match key.code {
                KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => return Ok(()),
                KeyCode::Char('q') | KeyCode::Esc => return Ok(()),
                KeyCode::Tab => group = group.other(),
                _ => {}
            }
        }
        let next_frame = Some(Instant::now() + FRAME);
        while let Some(received) = cable.next(next_frame)? {
            messages.take(received);
            last_received = Instant::now();
        }
        if cable.is_disconnected() {
            return Ok(());
        }
    }
}
