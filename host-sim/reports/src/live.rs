//! The live view of a growing record: verdict, curves, findings, health of the source.

use crate::finding_text::FindingText;
use crate::rounding::extremes;
use crate::summary::CoefficientTable;
use crate::terminal::table_lines;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Axis, Block, Borders, Chart, Dataset, GraphType, Paragraph, Wrap};

const TABLE_COLUMNS: usize = 80;
/// Least rows of a screen with the data sheet's row.
const ROWS_FOR_SHEET: u16 = 30;

#[derive(Debug, Clone, PartialEq)]
pub struct LiveCurve {
    pub channel: String,
    pub unit: String,
    /// Averaging time, s, and deviation.
    pub points: Vec<(f64, f64)>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum CurveGroup {
    #[default]
    Gyros,
    Accelerometers,
}

impl CurveGroup {
    pub fn other(self) -> Self {
        if self == Self::Gyros { Self::Accelerometers } else { Self::Gyros }
    }

    fn prefix(self) -> &'static str {
        if self == Self::Gyros { "gyro_" } else { "accl_" }
    }
}

#[derive(Debug, Clone, PartialEq, Default)]
pub struct LiveView {
    pub headline: String,
    pub sentences: String,
    pub tables: Vec<CoefficientTable>,
    pub curves: Vec<LiveCurve>,
    pub findings: Vec<FindingText>,
    pub unexplained: Vec<String>,
    /// Departures from the model, and advice.
    pub advice: Vec<String>,
    pub health: String,
    pub status: String,
}

impl LiveView {
    /// Draws on the whole frame, at least 80 columns by 24 rows.
    pub fn draw(&self, frame: &mut Frame<'_>, group: CurveGroup, in_colour: bool) {
        let area = frame.area();
        let text_rows = rows_of(&self.sentences, area.width).min(3);
        let health_rows = rows_of(&self.health, area.width).min(2);
        let tables = self.table_text(area, in_colour);
        let [head, sentences, coefficients, middle, health, status] = Layout::vertical([
            Constraint::Length(1),
            Constraint::Length(text_rows),
            Constraint::Length(u16::try_from(tables.len()).unwrap_or(u16::MAX)),
            Constraint::Min(6),
            Constraint::Length(health_rows),
            Constraint::Length(1),
        ])
        .areas(area);
        let bold = Style::new().add_modifier(Modifier::BOLD);
        frame.render_widget(Paragraph::new(Span::styled(self.headline.as_str(), bold)), head);
        frame.render_widget(Paragraph::new(self.sentences.as_str()).wrap(Wrap { trim: true }), sentences);
        frame.render_widget(Paragraph::new(tables), coefficients);
        let [left, right] = Layout::horizontal([Constraint::Percentage(50), Constraint::Percentage(50)]).areas(middle);
        self.draw_curves(frame, left, group, in_colour);
        let found = Block::new().borders(Borders::TOP).title("What was found");
        frame.render_widget(Paragraph::new(self.found_text(in_colour)).wrap(Wrap { trim: false }).block(found), right);
        frame.render_widget(Paragraph::new(self.health.as_str()).wrap(Wrap { trim: true }), health);
        let reversed = Style::new().add_modifier(Modifier::REVERSED);
        let keys = "q ends, Tab other curves";
        let status_text = if self.status.is_empty() { keys.to_owned() } else { format!("{}; {keys}", self.status) };
        frame.render_widget(Paragraph::new(status_text).style(reversed), status);
    }

    /// The tables, without the data sheet's rows on a low screen.
    fn table_text(&self, area: Rect, in_colour: bool) -> Vec<Line<'static>> {
        let columns = usize::from(area.width).clamp(TABLE_COLUMNS, 120);
        let mut lines = Vec::new();
        for (index, table) in self.tables.iter().enumerate() {
            let mut table = table.clone();
            if area.height < ROWS_FOR_SHEET {
                table.rows.retain(|row| !row.channel.is_empty());
            }
            for (style, text) in table_lines(&table, index == 0, columns) {
                let with =
                    |effect, modifier| if style.get_effects().contains(effect) { modifier } else { Modifier::empty() };
                let bold = with(anstyle::Effects::BOLD, Modifier::BOLD);
                let shown = Style::new().add_modifier(bold | with(anstyle::Effects::DIMMED, Modifier::DIM));
                let is_coloured = in_colour && style.get_fg_color().is_some();
                lines.push(Line::styled(text, if is_coloured { shown.fg(Color::Yellow) } else { shown }));
            }
        }
        lines
    }

    fn found_text(&self, in_colour: bool) -> Vec<Line<'_>> {
        let warning = if in_colour { Style::new().fg(Color::Yellow) } else { Style::new() };
        let mut lines: Vec<Line<'_>> =
            self.findings.iter().map(|finding| Line::raw(format!("{}: {}", finding.channels, finding.brief))).collect();
        if lines.is_empty() && self.unexplained.is_empty() {
            lines.push(Line::raw("Nothing beyond N, B and K yet."));
        }
        lines.extend(self.unexplained.iter().map(|text| Line::styled(format!("Not explained: {text}."), warning)));
        lines.extend(self.advice.iter().map(|text| Line::raw(format!("> {text}"))));
        lines
    }

    /// Logarithmic axes; the points are the letters of the axes.
    fn draw_curves(&self, frame: &mut Frame<'_>, area: Rect, group: CurveGroup, in_colour: bool) {
        let logarithmic = |curve: &LiveCurve| -> Vec<(f64, f64)> {
            let positive = curve.points.iter().filter(|(tau, deviation)| *tau > 0.0 && *deviation > 0.0);
            positive.map(|(tau, deviation)| (tau.log10(), deviation.log10())).collect()
        };
        let shown: Vec<(&str, Vec<(f64, f64)>)> = self
            .curves
            .iter()
            .filter_map(|curve| Some((curve.channel.strip_prefix(group.prefix())?, logarithmic(curve))))
            .collect();
        let unit = self.curves.iter().find(|curve| curve.channel.starts_with(group.prefix()));
        let unit = unit.map_or_else(String::new, |curve| crate::rounding::unit(&curve.unit));
        let name = if group == CurveGroup::Gyros { "gyros" } else { "accels" };
        let block = Block::new().borders(Borders::TOP).title(format!("σ(τ) of the {name}, {unit} over s"));
        let points = || shown.iter().flat_map(|(_, points)| points);
        if points().next().is_none() {
            frame.render_widget(Paragraph::new("No curve yet.").block(block), area);
            return;
        }
        let bounds = |of: fn(&(f64, f64)) -> f64| {
            let (low, high) = extremes(points().map(of));
            [low.floor(), high.ceil().max(low.floor() + 1.0)]
        };
        let (x, y) = (bounds(|point| point.0), bounds(|point| point.1));
        let datasets = shown.iter().map(|(axis, points)| {
            let letter = axis.chars().next().unwrap_or('·');
            let style = match letter {
                _ if !in_colour => Style::new(),
                'x' => Style::new().fg(Color::Cyan),
                'y' => Style::new().fg(Color::Magenta),
                _ => Style::new().fg(Color::Green),
            };
            Dataset::default().marker(Marker::Custom(letter)).graph_type(GraphType::Scatter).style(style).data(points)
        });
        let chart = Chart::new(datasets.collect())
            .block(block)
            .x_axis(Axis::default().bounds(x).labels(powers_of_ten(x)))
            .y_axis(Axis::default().bounds(y).labels(powers_of_ten(y)));
        frame.render_widget(chart, area);
    }
}

fn powers_of_ten(bounds: [f64; 2]) -> [String; 2] {
    bounds.map(|exponent| match exponent {
        exponent if (-3.0..=4.0).contains(&exponent) => format!("{}", 10f64.powf(exponent)),
        exponent => format!("1e{exponent}"),
    })
}

/// Upper bound of the rows of a text at `columns`.
fn rows_of(text: &str, columns: u16) -> u16 {
    let wrapped = crate::formatting::wrap(text, usize::from(columns.max(1)));
    u16::try_from(wrapped.lines().count()).unwrap_or(u16::MAX)
}
