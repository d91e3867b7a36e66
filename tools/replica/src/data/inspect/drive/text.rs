//! The report as text.

use super::DriveReport;
use super::stream::{Gap, Stream, seconds_between};
use geometry::Stamp;
use run::space::size_text;
use std::fmt::Write;

/// The whole report.
pub fn render(report: &DriveReport) -> String {
    let mut text = format!("{} ({})\n\n", report.folder, report.name);
    let origin = report.origin();
    let rows: Vec<[String; 9]> = report.streams.iter().map(row).collect();
    let width = |column: usize| {
        rows.iter().chain([&HEADINGS.map(str::to_owned)]).map(|row| row[column].chars().count()).max().unwrap_or(0)
    };
    let widths: [usize; 9] = std::array::from_fn(width);
    for row in [&HEADINGS.map(str::to_owned)].into_iter().chain(&rows) {
        for (column, cell) in row.iter().enumerate() {
            let width = widths[column];
            // Writing to a string cannot fail. Names are aligned left, numbers right.
            let _ = if column < 2 { write!(text, "{cell:<width$}  ") } else { write!(text, "{cell:>width$}  ") };
        }
        text.truncate(text.trim_end_matches(' ').len());
        text.push('\n');
    }
    for stream in &report.streams {
        text.push_str(&gap_lines(stream, origin));
    }
    for section in &report.sections {
        let _ = writeln!(text, "\n{}", section.heading);
        section.lines.iter().for_each(|line| {
            let _ = writeln!(text, "  {line}");
        });
    }
    let _ = writeln!(text, "\nDoubts: {}", if report.doubts.is_empty() { "none" } else { "" });
    text.truncate(text.trim_end().len());
    text.push('\n');
    for doubt in &report.doubts {
        let _ = writeln!(text, "  - {}", doubt.replace('\n', "\n    "));
    }
    text
}

/// Headings of the table of sensors.
pub const HEADINGS: [&str; 9] =
    ["sensor", "kind", "files", "size", "messages", "rate Hz", "jitter ms", "gaps", "longest s"];

/// A row of the table of sensors.
pub fn row(stream: &Stream) -> [String; 9] {
    let number = |value: Option<f64>, digits: usize| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.digits$}"));
    let gaps = stream.gaps();
    let more = if stream.is_partial() { "+" } else { "" };
    [
        stream.name.clone(),
        stream.kind.clone(),
        if stream.n_files == 0 { "-".to_owned() } else { stream.n_files.to_string() },
        if stream.n_bytes == 0 { "-".to_owned() } else { size_text(stream.n_bytes) },
        format!("{}{more}", stream.len()),
        number(stream.rate_hz(), 2),
        number(stream.jitter_s().map(|jitter_s| jitter_s * 1e3), 2),
        format!("{}{more}", gaps.n),
        number(gaps.longest.map(|gap| gap.seconds), 3),
    ]
}

/// The gaps of a stream with their times; empty without gaps.
pub fn gap_lines(stream: &Stream, origin: Stamp) -> String {
    let gaps = stream.gaps();
    if gaps.n == 0 {
        return String::new();
    }
    let limit_s = stream.gap_limit_s().unwrap_or(0.0);
    let one = |gap: &Gap| format!("{:.3} s at {:+.3} s", gap.seconds, seconds_between(gap.begin, origin));
    let listed: Vec<String> = gaps.listed.iter().map(one).collect();
    let more =
        if gaps.n > gaps.listed.len() { format!(", and {} more", gaps.n - gaps.listed.len()) } else { String::new() };
    format!("gaps of {} (longer than {limit_s:.3} s): {}{more}\n", stream.name, listed.join(", "))
}
