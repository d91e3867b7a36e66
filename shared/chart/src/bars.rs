//! Horizontal bars, one row below the other.

use crate::draw::escaped;
use std::fmt::Write;

/// Height of a row, px.
const ROW: f64 = 26.0;
/// Height of a bar, px.
const BAR: f64 = 14.0;
/// Average width of a letter of a name, px.
const LETTER: f64 = 7.2;
/// Width of the drawing, px.
const WIDTH: f64 = 900.0;
/// Room right of the bars for the text of a row, px.
const RIGHT: f64 = 110.0;

/// A row: its name, its pieces, and a text after them.
#[derive(Clone, Debug, PartialEq)]
pub struct BarRow {
    /// Text to the left of the bar.
    pub name: String,
    /// Pieces in drawing order: from, to (in the unit of the axis), SVG color.
    pub pieces: Vec<([f64; 2], String)>,
    /// Text to the right of all bars; may be empty.
    pub text: String,
}

/// Content of an SVG file with rows over one axis of this range. `ends`: texts below its ends.
pub fn bars(rows: &[BarRow], [begin, end]: [f64; 2], ends: [&str; 2]) -> String {
    let n_letters = rows.iter().map(|row| row.name.chars().count()).max().unwrap_or(0);
    let left = (n_letters as f64 * LETTER + 14.0).min(0.4 * WIDTH);
    let right = if rows.iter().all(|row| row.text.is_empty()) { 10.0 } else { RIGHT };
    let length = WIDTH - left - right;
    let span = (end - begin).max(1e-9);
    let x = |at: f64| left + length * ((at - begin) / span).clamp(0.0, 1.0);
    let has_ends = ends.iter().any(|text| !text.is_empty());
    let height = ROW * (rows.len() as f64 + f64::from(u8::from(has_ends)));
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{height}\" viewBox=\"0 0 {WIDTH} {height}\" \
         font-family=\"sans-serif\" font-size=\"13\">\n"
    );
    // Writing to a string cannot fail.
    for (index, row) in rows.iter().enumerate() {
        let y = ROW * index as f64;
        let name = escaped(&row.name);
        let text = escaped(&row.text);
        let at = left - 10.0;
        let _ = writeln!(svg, "<text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"end\">{name}</text>", y + 17.0);
        for ([from, to], color) in &row.pieces {
            let width = (x(*to) - x(*from)).max(1.0);
            let from = x(*from);
            let top = y + 6.0;
            let color = escaped(color);
            let _ = writeln!(
                svg,
                "<rect x=\"{from:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{BAR}\" fill=\"{color}\"/>"
            );
        }
        if !text.is_empty() {
            let _ = writeln!(svg, "<text x=\"{:.1}\" y=\"{:.1}\">{text}</text>", left + length + 8.0, y + 17.0);
        }
    }
    if has_ends {
        let y = height - 8.0;
        let [first, last] = ends.map(escaped);
        let _ = writeln!(svg, "<text x=\"{left:.1}\" y=\"{y:.1}\">{first}</text>");
        let _ = writeln!(svg, "<text x=\"{:.1}\" y=\"{y:.1}\" text-anchor=\"end\">{last}</text>", left + length);
    }
    svg + "</svg>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bar_has_the_length_of_its_share_of_the_axis() {
        let row = |name: &str, to: f64| BarRow {
            name: name.to_owned(),
            pieces: vec![([0.0, to], "#123456".to_owned())],
            text: String::new(),
        };
        let svg = bars(&[row("a<b", 5.0), row("c", 10.0)], [0.0, 10.0], ["0 s", "10 s"]);
        let widths: Vec<f64> = svg
            .split("<rect ")
            .skip(1)
            .filter_map(|rect| rect.split("width=\"").nth(1)?.split('"').next()?.parse().ok())
            .collect();
        assert!((widths[1] - 2.0 * widths[0]).abs() < 0.2, "{widths:?}");
        assert!(svg.contains(">a&lt;b</text>") && svg.contains(">10 s</text>"), "{svg}");
    }
}
