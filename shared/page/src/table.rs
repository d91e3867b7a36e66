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
