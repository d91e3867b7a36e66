//! SVG elements of a chart.

use crate::{Chart, Mark, Series};
use std::fmt::Write;

/// Margins around the plot area, px.
pub const LEFT: f64 = 60.0;
const RIGHT: f64 = 20.0;
const BOTTOM: f64 = 48.0;
/// Average width of a letter in the legend, px.
const LETTER: f64 = 7.7;
/// Height of a line of text, px.
const LINE: f64 = 18.0;

/// Width and height of a chart with margins, px.
pub fn outer(chart: &Chart) -> [f64; 2] {
    [LEFT + chart.size[0] + RIGHT, top(chart) + chart.size[1] + BOTTOM]
}

/// Top of the plot area: below title, legend and y-axis label, where present.
pub fn top(chart: &Chart) -> f64 {
    let n_lines = [&chart.title, &chart.y.label].iter().filter(|text| !text.is_empty()).count();
    let n_rows = legend(chart).iter().map(|entry| entry.row + 1).max().unwrap_or(0);
    12.0 + LINE * (n_lines + n_rows) as f64
}

/// All elements of a chart, its upper left corner at 0 0.
pub fn chart(chart: &Chart) -> String {
    let [width, height] = chart.size;
    let top = top(chart);
    let right = LEFT + width;
    let bottom = top + height;
    let place = |[x, y]: [f64; 2]| [LEFT + width * chart.x.share(x), top + height * (1.0 - chart.y.share(y))];
    let mut svg = String::new();
    // Writing to a string cannot fail.
    let _ = writeln!(svg, "<text x=\"{LEFT}\" y=\"20\" font-size=\"15\">{}</text>", escaped(&chart.title));
    if chart.x.has_numbers {
        // A number needs about 60 px.
        for x in chart.x.ticks((width / 60.0).min(8.0)) {
            let [at, _] = place([x, 0.0]);
            let _ = writeln!(svg, "<path d=\"M{at:.1} {bottom:.1}V{top:.1}\" stroke=\"#ddd\"/>");
            let _ = writeln!(svg, "<text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{x}</text>", bottom + 18.0);
        }
    }
    if chart.y.has_numbers {
        for y in chart.y.ticks((height / 30.0).min(8.0)) {
            let [_, at] = place([0.0, y]);
            let _ = writeln!(svg, "<path d=\"M{LEFT:.1} {at:.1}H{right:.1}\" stroke=\"#ddd\"/>");
            let _ = writeln!(svg, "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{y}</text>", LEFT - 6.0, at + 4.0);
        }
    }
    let x_label = escaped(&chart.x.label);
    let _ = writeln!(svg, "<text x=\"{right}\" y=\"{}\" text-anchor=\"end\">{x_label}</text>", bottom + 36.0);
    let _ = writeln!(svg, "<text x=\"8\" y=\"{}\">{}</text>", top - 8.0, escaped(&chart.y.label));
    for series in &chart.series {
        draw_series(&mut svg, series, &place, [width, bottom], chart.x.range);
    }
    let _ = writeln!(svg, "<path d=\"M{LEFT} {bottom}H{right}\" stroke=\"black\"/>");
    let title_height = if chart.title.is_empty() { 0.0 } else { LINE };
    for Entry { name, color, left, row } in legend(chart) {
        let y = title_height + LINE * (row + 1) as f64;
        let _ = writeln!(svg, "<path d=\"M{left:.1} {}h16\" stroke=\"{color}\" stroke-width=\"3\"/>", y - 4.0);
        let _ = writeln!(svg, "<text x=\"{:.1}\" y=\"{y}\">{}</text>", left + 21.0, escaped(name));
    }
    svg
}

fn draw_series(
    svg: &mut String,
    series: &Series,
    place: &impl Fn([f64; 2]) -> [f64; 2],
    [width, bottom]: [f64; 2],
    range: [f64; 2],
) {
    let color = series.color;
    let is_finite = |p: &&[f64; 2]| p.iter().all(|value| value.is_finite());
    let placed = series.points().iter().filter(is_finite).map(|p| place(*p));
    match series.mark {
        Mark::Line { width, .. } => {
            let points: Vec<String> = placed.map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
            let _ = writeln!(
                svg,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"{width}\" stroke-opacity=\"0.85\"/>",
                points.join(" ")
            );
        }
        Mark::Bars { width: bar, .. } => {
            let bar = bar / (range[1] - range[0]) * width;
            for [x, y] in placed {
                let left = x - 0.5 * bar;
                let high = bottom - y;
                let _ = writeln!(
                    svg,
                    "<rect x=\"{left:.1}\" y=\"{y:.1}\" width=\"{bar:.2}\" height=\"{high:.1}\" fill=\"{color}\"/>"
                );
            }
        }
        Mark::Dots { radius, .. } => {
            for [x, y] in placed {
                let _ = writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" fill=\"{color}\"/>");
            }
        }
    }
}

/// An entry of the legend and its position.
struct Entry<'a> {
    name: &'a str,
    color: &'a str,
    left: f64,
    row: usize,
}

/// Entries of the legend. It is drawn above the plot area, so it never covers data: in as many rows as needed, right-aligned if
/// one row is enough.
fn legend(chart: &Chart) -> Vec<Entry<'_>> {
    let right = LEFT + chart.size[0];
    let width = |name: &str| 30.0 + LETTER * name.chars().count() as f64;
    let mut entries: Vec<Entry<'_>> = Vec::new();
    let mut left = LEFT;
    let mut row = 0;
    for Series { name, color, .. } in &chart.series {
        let is_new = |entry: &Entry<'_>| entry.name != name.as_str() || entry.color != *color;
        if name.is_empty() || !entries.iter().all(is_new) {
            continue;
        }
        if left > LEFT && left + width(name) > right + RIGHT {
            left = LEFT;
            row += 1;
        }
        entries.push(Entry { name, color, left, row });
        left += width(name);
    }
    if row == 0 {
        for entry in &mut entries {
            entry.left += (right - left).max(0.0);
        }
    }
    entries
}

/// Text inside an element or an attribute of SVG or HTML.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
