//! The comparison as Markdown.

use super::interval::Interval;
use super::{Comparison, Row, Verdict};
use std::fmt::Write;

const HEAD: &str = "| cores | part | figure | A | B | change | |\n|---|---|---|---|---|---|---|\n";

impl Comparison {
    /// Changed figures as a table, notes, and the number of the others.
    pub fn text(&self) -> String {
        let mut text = String::new();
        for note in &self.notes {
            // Writing to a string cannot fail, here and below.
            let _ = writeln!(text, "note: {note}");
        }
        let of_interest: Vec<&Row> = self.rows.iter().filter(|row| row.verdict != Verdict::Same).collect();
        if !of_interest.is_empty() {
            let _ = write!(text, "{HEAD}{}", of_interest.iter().map(|row| line(row)).collect::<String>());
        }
        let n = |verdict| self.rows.iter().filter(|row| row.verdict == verdict).count();
        let _ = writeln!(
            text,
            "{} figures: {} worse, {} better, {} changed within the noise, {} changed by less than {} %",
            self.rows.len(),
            n(Verdict::Worse),
            n(Verdict::Better),
            n(Verdict::Noise),
            n(Verdict::Same),
            self.limit_percent
        );
        text
    }
}

fn line(row: &Row) -> String {
    let part = row.stage.as_deref().unwrap_or("run");
    let change = row.change_percent.map_or("from 0".to_owned(), |percent| format!("{percent:+.1} %"));
    let verdict = match row.verdict {
        Verdict::Same => "",
        Verdict::Noise => "noise",
        Verdict::Better => "better",
        Verdict::Worse => "**worse**",
    };
    let [a, b] = [row.a, row.b].map(|Interval { median, low, high }| format!("{median:.2} ({low:.2} to {high:.2})"));
    format!("| {} | {part} | {} | {a} | {b} | {change} | {verdict} |\n", row.configuration.cores, row.figure)
}
