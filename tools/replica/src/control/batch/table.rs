//! The table of the results as text, CSV or JSON.

use super::results::{DriveOutcome, Row, doubt_names};
use files::csv::csv_cell;
use std::fmt::Write;

/// How the table is printed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// Aligned columns, and totals.
    #[default]
    Text,
    /// Comma-separated values with a header line.
    Csv,
    /// A list of objects.
    Json,
}

/// The table.
pub fn text(rows: &[Row], format: Format) -> Result<String, serde_json::Error> {
    Ok(match format {
        Format::Text => format!("{}{}\n", aligned(rows), totals(rows)),
        Format::Csv => csv(rows),
        Format::Json => serde_json::to_string_pretty(rows)? + "\n",
    })
}

fn aligned(rows: &[Row]) -> String {
    let width = rows.iter().map(|row| row.drive.chars().count()).max().unwrap_or_default().max(5);
    let mut text =
        format!("{:width$}  outcome      drive s   wall s  times real time  M points    CPU s  doubts\n", "drive");
    for row in rows {
        let mut line = format!("{:width$}  {:<10}", row.drive, row.outcome.text());
        if row.points > 0 || row.is_finished() {
            let points = row.points as f64 * 1e-6;
            // Writing to a string cannot fail.
            let _ = write!(
                line,
                " {:9.1} {:8.1} {:16.2} {points:9.2} {:8.1}  {}",
                row.drive_s,
                row.wall_s,
                row.times_real_time,
                row.cpu_s,
                doubt_names(&row.doubts)
            );
        }
        text += line.trim_end();
        text.push('\n');
    }
    text
}

/// One line about all drives. Figures are sums over the finished ones.
pub fn totals(rows: &[Row]) -> String {
    if rows.is_empty() {
        return "no drive belongs to this job".to_owned();
    }
    let counts: Vec<String> = DriveOutcome::ALL
        .iter()
        .map(|outcome| (rows.iter().filter(|row| row.outcome == *outcome).count(), outcome.text()))
        .filter(|(n, _)| *n > 0)
        .map(|(n, text)| format!("{n} {text}"))
        .collect();
    let sum =
        |of: fn(&Row) -> f64| rows.iter().filter(|row| row.is_finished()).map(of).fold(0.0, |sum, value| sum + value);
    let drive_s = sum(|row| row.drive_s);
    let wall_s = sum(|row| row.wall_s);
    let cpu_s = sum(|row| row.cpu_s);
    let times = if wall_s > 0.0 { drive_s / wall_s } else { 0.0 };
    let plural = if rows.len() == 1 { "" } else { "s" };
    format!(
        "{} drive{plural}: {}; finished: {drive_s:.1} s of drive in {wall_s:.1} s ({times:.2} times real time), {:.2} M \
         points, {cpu_s:.1} s CPU",
        rows.len(),
        counts.join(", "),
        sum(|row| row.points as f64 * 1e-6)
    )
}

fn csv(rows: &[Row]) -> String {
    let mut text = "drive,outcome,drive_s,wall_s,times_real_time,points,cpu_s,doubts\n".to_owned();
    for row in rows {
        let Row { drive_s, wall_s, times_real_time, points, cpu_s, .. } = row;
        let drive = csv_cell(&row.drive);
        let outcome = row.outcome.text();
        let doubts = doubt_names(&row.doubts);
        let _ = writeln!(
            text,
            "{drive},{outcome},{drive_s:.3},{wall_s:.3},{times_real_time:.3},{points},{cpu_s:.3},{doubts}"
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(drive: &str, outcome: DriveOutcome, seconds: f64) -> Row {
        let drive = drive.to_owned();
        Row { drive, outcome, drive_s: 3.0 * seconds, wall_s: seconds, points: 7_000_000, ..Row::default() }
    }

    #[test]
    fn totals_are_sums_over_finished_drives() {
        let mut doubtful = row("b", DriveOutcome::Doubts, 2.0);
        doubtful.doubts = ["path_lost", "few_fixes"].map(str::to_owned).into();
        let rows =
            [row("a", DriveOutcome::Complete, 1.0), doubtful, row("c", DriveOutcome::Failed, 50.0), Row::default()];
        assert_eq!(
            totals(&rows),
            "4 drives: 1 complete, 1 doubts, 1 failed, 1 not_run; finished: 9.0 s of drive in 3.0 s (3.00 times real \
             time), 14.00 M points, 0.0 s CPU"
        );
        // The sum of no numbers is -0.0.
        assert!(totals(&rows[3..]).contains("finished: 0.0 s of drive in 0.0 s"), "{}", totals(&rows[3..]));
        let table = text(&rows, Format::Text).expect("text");
        assert!(table.lines().nth(2).is_some_and(|line| line.ends_with("few_fixes path_lost")), "{table}");
    }

    #[test]
    fn name_with_comma_or_quote_stays_one_field() {
        let rows = [row("mon,\"day\"", DriveOutcome::Complete, 1.0)];
        let text = text(&rows, Format::Csv).expect("text");
        assert_eq!(text.lines().nth(1), Some("\"mon,\"\"day\"\"\",complete,3.000,1.000,0.000,7000000,0.000,"));
    }

    #[test]
    fn name_of_a_drive_is_no_formula() {
        let rows = [row("=1+2", DriveOutcome::Complete, 1.0)];
        let text = text(&rows, Format::Csv).expect("text");
        assert!(text.lines().nth(1).is_some_and(|line| line.starts_with("'=1+2,complete,")), "{text}");
    }

    #[test]
    fn json_has_one_object_per_drive() {
        let rows = [row("a", DriveOutcome::Complete, 1.0), Row::default()];
        let text = text(&rows, Format::Json).expect("text");
        let parsed: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!((&parsed[0]["outcome"], &parsed[1]["outcome"]), (&"complete".into(), &"not_run".into()));
        assert_eq!(parsed[0]["points"], 7_000_000);
    }
}
