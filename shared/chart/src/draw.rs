//! A chart's elements.

use crate::{Chart, Mark, Series};
use std::fmt::Write;

/// Around the plane, px.
pub const LEFT: f64 = 60.0;
pub const TOP: f64 = 76.0;
const RIGHT: f64 = 20.0;
const BOTTOM: f64 = 48.0;
/// px that a letter takes on the average, for the legend.
const LETTER: f64 = 7.2;

/// Width and height with everything around it, px.
pub fn outer(chart: &Chart) -> [f64; 2] {
    [LEFT + chart.size[0] + RIGHT, TOP + chart.size[1] + BOTTOM]
}

/// All of a chart, its outer corner at 0 0.
pub fn chart(chart: &Chart) -> String {
    let [width, height] = chart.size;
    let (right, bottom) = (LEFT + width, TOP + height);
    let place = |[x, y]: [f64; 2]| [LEFT + width * chart.x.share(x), TOP + height * (1.0 - chart.y.share(y))];
    let mut svg = String::new();
    // Writing to a string cannot fail.
    let _ = writeln!(svg, "<text x=\"{LEFT}\" y=\"20\" font-size=\"15\">{}</text>", escaped(&chart.title));
    if chart.x.has_numbers {
        // A number needs about 60 px.
        for x in chart.x.ticks((width / 60.0).min(8.0)) {
            let [at, _] = place([x, 0.0]);
            let _ = writeln!(svg, "<path d=\"M{at:.1} {bottom:.1}V{TOP:.1}\" stroke=\"#ddd\"/>");
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
    let _ = writeln!(svg, "<text x=\"8\" y=\"{}\">{}</text>", TOP - 8.0, escaped(&chart.y.label));
    for series in &chart.series {
        draw_series(&mut svg, series, &place, [width, bottom], chart.x.range);
    }
    let _ = writeln!(svg, "<path d=\"M{LEFT} {bottom}H{right}\" stroke=\"black\"/>");
    legend(&mut svg, &chart.series, right);
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
                let (left, high) = (x - 0.5 * bar, bottom - y);
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

/// From the right, above the plane, so that it never lies on the data; as many rows as it takes.
fn legend(svg: &mut String, series: &[Series], right: f64) {
    let mut seen: Vec<(&str, &str)> = Vec::new();
    for one in series {
        if !one.name.is_empty() && !seen.contains(&(&one.name, one.color)) {
            seen.push((&one.name, one.color));
        }
    }
    let width = |name: &str| 30.0 + LETTER * name.chars().count() as f64;
    let mut left = right - seen.iter().map(|(name, _)| width(name)).sum::<f64>();
    left = left.max(LEFT);
    let mut y = 38.0;
    for (name, color) in seen {
        if left > LEFT && left + width(name) > right + RIGHT {
            (left, y) = (LEFT, y + 15.0);
        }
        let _ = writeln!(svg, "<path d=\"M{left:.1} {}h16\" stroke=\"{color}\" stroke-width=\"3\"/>", y - 4.0);
        let _ = writeln!(svg, "<text x=\"{:.1}\" y=\"{y}\">{}</text>", left + 21.0, escaped(name));
        left += width(name);
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
