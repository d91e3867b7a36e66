//! Tables that fit a terminal: the least important columns are left out where it is narrow.

use std::fmt::Write;

/// A column.
pub struct Column {
    pub heading: &'static str,
    /// Least width, characters.
    pub width: usize,
    /// 0: never left out; columns with larger numbers are left out first.
    pub rank: u8,
}

/// The first columns that are texts are aligned left, all others right.
pub struct Table<'a> {
    pub columns: &'a [Column],
    pub n_texts: usize,
    pub rows: Vec<Vec<String>>,
}

impl Table<'_> {
    /// Lines of at most `width` characters, if the columns of rank 0 fit.
    pub fn text(&self, width: usize) -> String {
        let width_of = |index: usize| {
            let cells = self.rows.iter().map(|row| row[index].chars().count());
            cells.chain([self.columns[index].heading.chars().count(), self.columns[index].width]).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.columns.len()).map(width_of).collect();
        let mut shown: Vec<usize> = (0..self.columns.len()).collect();
        let total = |shown: &[usize]| shown.iter().map(|index| widths[*index] + 1).sum::<usize>();
        while total(&shown) > width.saturating_add(1) {
            let Some(least) =
                shown.iter().copied().filter(|i| self.columns[*i].rank > 0).max_by_key(|i| self.columns[*i].rank)
            else {
                break;
            };
            shown.retain(|index| *index != least);
        }
        let headings: Vec<String> = self.columns.iter().map(|column| column.heading.to_owned()).collect();
        let mut text = String::new();
        for row in std::iter::once(&headings).chain(&self.rows) {
            for &index in &shown {
                let cell = &row[index];
                let width = widths[index];
                // Writing to a string cannot fail.
                let _ = if index < self.n_texts {
                    write!(text, "{cell:<width$} ")
                } else {
                    write!(text, "{cell:>width$} ")
                };
            }
            text.truncate(text.trim_end_matches(' ').len());
            text.push('\n');
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLUMNS: [Column; 3] = [
        Column { heading: "NAME", width: 6, rank: 0 },
        Column { heading: "MS", width: 4, rank: 2 },
        Column { heading: "CPU", width: 4, rank: 1 },
    ];

    #[test]
    fn least_important_columns_are_left_out_first() {
        let rows = vec![["infer", "12", "96"].map(str::to_owned).into()];
        let table = Table { columns: &COLUMNS, n_texts: 1, rows };
        assert_eq!(table.text(80), "NAME     MS  CPU\ninfer    12   96\n");
        assert_eq!(table.text(16), table.text(80));
        assert_eq!(table.text(usize::MAX), table.text(80), "a pipe has no width");
        assert_eq!(table.text(15), "NAME    CPU\ninfer    96\n");
        assert_eq!(table.text(3), "NAME\ninfer\n", "the name stays");
    }
}
