//! Line charts as SVG.

use std::fmt::Write;

const SIZE: [f64; 2] = [640.0, 360.0];
const MARGIN: f64 = 56.0;
/// Told apart by people with any kind of color vision (Okabe and Ito).
pub const COLORS: [&str; 6] = ["#0072b2", "#009e73", "#cc79a7", "#d55e00", "#e69f00", "#555555"];

/// One line.
pub struct Line {
    /// Lines of one group have one color and one entry in the legend.
    pub group: usize,
    /// x and y.
    pub points: Vec<[f64; 2]>,
}

/// A chart.
pub struct Chart<'a> {
    /// Above it.
    pub title: &'a str,
    /// Below and beside it, with units.
    pub axes: [&'a str; 2],
    /// Range of x.
    pub x: [f64; 2],
    /// Range of y.
    pub y: [f64; 2],
    /// Names of the groups.
    pub groups: &'a [String],
    /// The data.
    pub lines: &'a [Line],
}

impl Chart<'_> {
    /// The file's text.
    pub fn svg(&self) -> String {
        let [width, height] = SIZE.map(|side| side + 2.0 * MARGIN);
        let place = |[x, y]: [f64; 2]| {
            let share = |at: f64, [low, high]: [f64; 2]| (at.clamp(low, high) - low) / (high - low);
            [MARGIN + SIZE[0] * share(x, self.x), MARGIN + SIZE[1] * (1.0 - share(y, self.y))]
        };
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
             height=\"{height}\" font-family=\"sans-serif\" font-size=\"13\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n<text x=\"{MARGIN}\" y=\"24\" font-size=\"15\">{}</text>\n",
            escaped(self.title)
        );
        for x in ticks(self.x) {
            let ([at, bottom], [_, top]) = (place([x, self.y[0]]), place([x, self.y[1]]));
            let _ = writeln!(svg, "<path d=\"M{at:.1} {bottom:.1}V{top:.1}\" stroke=\"#ddd\"/>");
            let _ = writeln!(svg, "<text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{x}</text>", bottom + 18.0);
        }
        for y in ticks(self.y) {
            let ([left, at], [right, _]) = (place([self.x[0], y]), place([self.x[1], y]));
            let _ = writeln!(svg, "<path d=\"M{left:.1} {at:.1}H{right:.1}\" stroke=\"#ddd\"/>");
            let (x, y_text) = (left - 6.0, at + 4.0);
            let _ = writeln!(svg, "<text x=\"{x:.1}\" y=\"{y_text:.1}\" text-anchor=\"end\">{y}</text>");
        }
        let [right, bottom] = [MARGIN + SIZE[0], MARGIN + SIZE[1]];
        let (x_axis, y_axis) = (escaped(self.axes[0]), escaped(self.axes[1]));
        let _ = writeln!(svg, "<text x=\"{right}\" y=\"{}\" text-anchor=\"end\">{x_axis}</text>", bottom + 36.0);
        let _ = writeln!(svg, "<text x=\"8\" y=\"{}\">{y_axis}</text>", MARGIN - 10.0);
        for line in self.lines {
            let color = COLORS[line.group % COLORS.len()];
            let points: Vec<String> =
                line.points.iter().map(|p| place(*p)).map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
            let points = points.join(" ");
            let _ = writeln!(
                svg,
                "<polyline points=\"{points}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"1.3\" stroke-opacity=\"0.8\"/>"
            );
        }
        for (i, name) in self.groups.iter().enumerate() {
            let (y, color) = (MARGIN + 16.0 + 18.0 * i as f64, COLORS[i % COLORS.len()]);
            let (from, to, name) = (right - 8.0, right - 32.0, escaped(name));
            let _ = writeln!(svg, "<path d=\"M{from} {:.1}H{to}\" stroke=\"{color}\" stroke-width=\"3\"/>", y - 4.0);
            let _ = writeln!(svg, "<text x=\"{}\" y=\"{y:.1}\" text-anchor=\"end\">{name}</text>", to - 6.0);
        }
        svg.push_str("</svg>\n");
        svg
    }
}

/// Round numbers within a range: 1, 2 or 5 of a power of ten apart, four to ten of them.
fn ticks([low, high]: [f64; 2]) -> Vec<f64> {
    let rough = (high - low) / 8.0;
    let power = 10.0_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|k| k * power).into_iter().find(|step| *step >= rough).unwrap_or(rough);
    let (first, last) = ((low / step).ceil() as i64, (high / step + 1e-9).floor() as i64);
    // Multiples of 0.1 have odd last digits otherwise.
    (first..=last).map(|k| (k as f64 * step * 1e6).round() / 1e6).collect()
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks([0.0, 1.0]), [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]);
        assert_eq!(ticks([465.0, 640.0]), [500.0, 550.0, 600.0]);
    }
}
