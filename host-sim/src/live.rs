//! `monitor` on a terminal: the whole screen shows the verdict and the curves of a record while it grows.

mod device_source;
mod growing_recording;

pub(crate) use device_source::DeviceSource;
pub(crate) use growing_recording::GrowingRecording;

use crate::interrupt;
use anyhow::{Context, Result};
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use reports::live::{CurveGroup, LiveView};
use std::io::IsTerminal;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// Time between two drawings.
const FRAME: Duration = Duration::from_millis(100);

/// Where a growing record comes from.
pub(crate) trait LiveSource {
    /// Takes what has come, and waits for it until `deadline`. Returns false at the end of the source, after which nothing comes.
    ///
    /// # Errors
    /// The source fails.
    fn advance(&mut self, deadline: Instant) -> Result<bool>;

    /// What is shown now.
    fn view(&self) -> LiveView;
}

/// Whether the program has a terminal to draw on and to read keys from.
pub(crate) fn has_terminal() -> bool {
    std::io::stdout().is_terminal() && std::io::stdin().is_terminal()
}

/// Whether the user wants colour: `NO_COLOR` is not set, or empty.
fn wants_colour() -> bool {
    std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

/// Shows a source on the whole terminal until the user ends it, the source ends, `until`, or an interrupt. The terminal is
/// restored then, and also if the program panics.
///
/// # Errors
/// The source or the terminal fails.
pub(crate) fn show(source: &mut impl LiveSource, until: Option<Instant>) -> Result<()> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    // In the terminal's raw mode Ctrl-C is a key; this is for a signal from elsewhere.
    interrupt::on_signal(move || {
        flag.store(true, Relaxed);
        true
    });
    let shown = ratatui::try_init()
        .context("terminal")
        .and_then(|mut terminal| draw_until_end(source, &mut terminal, until, &interrupted));
    ratatui::restore();
    shown
}

fn draw_until_end(
    source: &mut impl LiveSource,
    terminal: &mut DefaultTerminal,
    until: Option<Instant>,
    interrupted: &AtomicBool,
) -> Result<()> {
    let in_colour = wants_colour();
    let mut group = CurveGroup::default();
    loop {
        let view = source.view();
        // A changed size of the terminal is taken up here.
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
        if !source.advance(Instant::now() + FRAME)? {
            return Ok(());
        }
    }
}
