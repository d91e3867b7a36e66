//! Tables.

use crate::Level;
use chart::escaped;
use std::fmt::Write;

/// A table: columns of text, then columns of numbers.
pub struct Table {
    headings: Vec<String>,
    /// Number of the first columns that are text.
    n_text: usize,
    rows: Vec<(Option<Level>, Vec<String>)>,
}

impl Table {
    /// A table without rows. The first `n_text` columns are text, aligned left; the others are numbers.
    pub fn new(headings: &[&str], n_text: usize) -> Self {
        let headings = headings.iter().map(|heading| (*heading).to_owned()).collect();
        Self { headings, n_text, rows: Vec::new() }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = impl Into<String>>) {
        self.rows.push((None, cells.into_iter().map(Into::into).collect()));
    }

    /// Adds a row in the color of the level.
    pub fn row_of(&mut self, level: Level, cells: impl IntoIterator<Item = impl Into<String>>) {
        self.rows.push((Some(level), cells.into_iter().map(Into::into).collect()));
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The table without the columns of numbers in which every number is 0 or absent (`-`).
    #[must_use]
    pub fn without_zero_columns(self) -> Self {
        let Self { headings, n_text, rows } = self;
        let is_zero = |cell: &String| cell == "-" || cell.parse() == Ok(0.0);
        let is_kept = |column: &usize| {
            let mut cells = rows.iter().filter_map(|(_, cells)| cells.get(*column));
            *column < n_text || rows.is_empty() || !cells.all(is_zero)
        };
        let kept: Vec<usize> = (0..headings.len()).filter(is_kept).collect();
        let chosen = |cells: &[String]| kept.iter().filter_map(|column| cells.get(*column).cloned()).collect();
        let headings = chosen(&headings);
        let rows = rows.iter().map(|(level, cells)| (*level, chosen(cells))).collect();
        Self { headings, n_text, rows }
    }

    // Writing to a string cannot fail.
    pub(crate) fn html(&self) -> String {
        let mut html = "<div class=\"table\"><table>\n<thead><tr>".to_owned();
        for (column, heading) in self.headings.iter().enumerate() {
            let _ = write!(html, "<th{}>{}</th>", self.class(column), escaped(heading));
        }
        html.push_str("</tr></thead>\n<tbody>\n");
        for (level, cells) in &self.rows {
            let level = level.map(|level| format!(" class=\"{}\"", level.word())).unwrap_or_default();
            let _ = write!(html, "<tr{level}>");
            for (column, cell) in cells.iter().enumerate() {
                let _ = write!(html, "<td{}>{}</td>", self.class(column), escaped(cell));
            }
            html.push_str("</tr>\n");
        }
        html + "</tbody></table></div>\n"
    }

    fn class(&self, column: usize) -> &'static str {
        if column < self.n_text { "" } else { " class=\"n\"" }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_zeros_are_left_out_and_texts_stay() {
        let mut table = Table::new(&["sensor", "jitter, ms", "gaps", "longest, s"], 1);
        table.row(["0", "0.00", "0", "-"]);
        table.row(["0", "0.00", "3", "-"]);
        let html = table.without_zero_columns().html();
        assert!(html.contains("sensor") && html.contains("gaps"), "{html}");
        assert!(!html.contains("jitter") && !html.contains("longest"), "{html}");
        assert_eq!(html.matches("<td").count(), 4);
    }
}
