//! SVG charts: lines, bars and dots over two axes, one chart or several on a sheet. Equal data gives equal bytes.
//!
//! | idea | item |
//! |---|---|
//! | a chart: title, two axes, series | [`Chart`] |
//! | a series and how its points are drawn | [`Series`], [`Mark`] |
//! | a range with round ticks | [`Axis`] |
//! | rows of bars with names | [`bars()`] |
//! | several charts in one file | [`sheet`] |
//!
//! Written here, not taken from a plotting crate: 400 lines without fonts or rasterizer give reproducible bytes.
//!
//! What it must never do: read the clock, a font or a file, depend on the order of a hash map, or compute statistics:
//! callers provide the numbers. Colors stay distinguishable with any kind of color vision ([`COLORS`]).
//!
//! Where to start reading: [`Chart::svg`].

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod axis;
mod bars;
mod draw;

pub use axis::Axis;
pub use bars::{BarRow, bars};
pub use draw::escaped;

use std::fmt::Write;

/// Colors distinguishable with any kind of color vision (Okabe and Ito).
pub const COLORS: [&str; 8] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#555555", "#56b4e9", "#999999"];

/// Default size of the plot area, px.
pub const SIZE: [f64; 2] = [640.0, 360.0];

/// Largest plot area of a map, px.
const MAP_SIZE: [f64; 2] = [800.0, 640.0];
/// Smallest side of a map, px.
const MIN_MAP_SIDE: f64 = 240.0;

/// How the points of a series are drawn. x and y are in the units of the axes.
#[derive(Clone, Debug, PartialEq)]
pub enum Mark {
    /// Straight lines between consecutive points.
    Line {
        /// Vertices in order.
        points: Vec<[f64; 2]>,
        /// Width of the stroke, px.
        width: f64,
    },
    /// A bar from the bottom to each point.
    Bars {
        /// Middle of the top of each bar.
        points: Vec<[f64; 2]>,
        /// Width in units of x.
        width: f64,
    },
    /// A disk at each point.
    Dots {
        /// Centers.
        points: Vec<[f64; 2]>,
        /// Radius, px.
        radius: f64,
    },
}

/// A data series.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name in the legend. Series of equal name and color share an entry; a series with an empty name has no entry.
    pub name: String,
    /// SVG color.
    pub color: &'static str,
    /// Points and their drawing style.
    pub mark: Mark,
}

impl Series {
    /// A line.
    pub fn line(name: impl Into<String>, color: &'static str, points: Vec<[f64; 2]>) -> Self {
        Self { name: name.into(), color, mark: Mark::Line { points, width: 1.6 } }
    }
    /// A line 1 px wide, for charts with many lines.
    pub fn thin_line(name: impl Into<String>, color: &'static str, points: Vec<[f64; 2]>) -> Self {
        Self { name: name.into(), color, mark: Mark::Line { points, width: 1.0 } }
    }
    /// Bars, each `width` wide in units of x.
    pub fn bars(name: impl Into<String>, color: &'static str, points: Vec<[f64; 2]>, width: f64) -> Self {
        Self { name: name.into(), color, mark: Mark::Bars { points, width } }
    }
    /// Dots of 3 px radius.
    pub fn dots(name: impl Into<String>, color: &'static str, points: Vec<[f64; 2]>) -> Self {
        Self { name: name.into(), color, mark: Mark::Dots { points, radius: 3.0 } }
    }
    /// The points of the series.
    pub fn points(&self) -> &[[f64; 2]] {
        match &self.mark {
            Mark::Line { points, .. } | Mark::Bars { points, .. } | Mark::Dots { points, .. } => points,
        }
    }
}

/// One plot area with its axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// Title above the plot area.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Series in drawing order.
    pub series: Vec<Series>,
    /// Size of the plot area, px.
    pub size: [f64; 2],
}

impl Chart {
    /// A chart of the default size.
    pub fn new(title: impl Into<String>, x: Axis, y: Axis, series: Vec<Series>) -> Self {
        Self { title: title.into(), x, y, series, size: SIZE }
    }

    /// A map: both axes have the same scale and all points are visible.
    pub fn map(title: impl Into<String>, axes: [&str; 2], series: Vec<Series>) -> Self {
        let [x, y] = [0, 1].map(|k| axis::range(series.iter().flat_map(Series::points).map(|point| point[k])));
        let [width, height] = [x, y].map(|[low, high]| high - low);
        // A narrow map still needs room for legend and numbers.
        let px_per_unit = (MAP_SIZE[0] / width).min(MAP_SIZE[1] / height);
        let size = [width, height].map(|side| (side * px_per_unit).max(MIN_MAP_SIDE).round());
        let widened = |[low, high]: [f64; 2], side: f64| {
            let more = 0.5 * (side / px_per_unit - (high - low));
            [low - more, high + more]
        };
        let [x, y] = [Axis::new(axes[0], widened(x, size[0])), Axis::new(axes[1], widened(y, size[1]))];
        Self { title: title.into(), x, y, series, size }
    }

    /// Content of an SVG file.
    pub fn svg(&self) -> String {
        sheet(std::slice::from_ref(self), 1)
    }
}

/// Content of an SVG file with several charts, `columns` in a row.
pub fn sheet(charts: &[Chart], columns: usize) -> String {
    let rows: Vec<&[Chart]> = charts.chunks(columns.max(1)).collect();
    let width_of = |row: &[Chart]| row.iter().map(|chart| draw::outer(chart)[0]).sum::<f64>();
    let height_of = |row: &[Chart]| row.iter().map(|chart| draw::outer(chart)[1]).fold(0.0, f64::max);
    let width = rows.iter().map(|row| width_of(row)).fold(0.0, f64::max);
    let height: f64 = rows.iter().map(|row| height_of(row)).sum();
    // Viewers that do not scale need a size in addition to the view box.
    let mut svg = format!(
        "<svg class=\"chart\" xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         font-family=\"sans-serif\" font-size=\"13\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    let mut top = 0.0;
    for row in rows {
        let mut left = 0.0;
        for chart in row {
            // Writing to a string cannot fail.
            let _ = writeln!(svg, "<g transform=\"translate({left} {top})\">\n{}</g>", draw::chart(chart));
            left += draw::outer(chart)[0];
        }
        top += height_of(row);
    }
    svg + "</svg>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart() -> Chart {
        let series = vec![
            Series::bars("b", COLORS[0], vec![[5.0, 2.0]], 1.0),
            Series::line("a < b", COLORS[1], vec![[0.0, 0.0], [10.0, 4.0]]),
            Series::line("a < b", COLORS[1], vec![[f64::NAN, 1.0], [2.0, 1.0]]),
        ];
        let x = Axis::new("x, m", [0.0, 10.0]);
        let y = Axis::new("y", [0.0, 4.0]);
        Chart { size: [100.0, 40.0], ..Chart::new("T & U", x, y, series) }
    }

    #[test]
    fn points_are_drawn_at_their_positions() {
        let svg = chart().svg();
        let [left, top] = [draw::LEFT, draw::top(&chart())];
        let line = format!("points=\"{:.1},{:.1} {:.1},{:.1}\"", left, top + 40.0, left + 100.0, top);
        assert!(svg.contains(&line), "{line} is not in\n{svg}");
        let bar = format!("x=\"{:.1}\" y=\"{:.1}\" width=\"10.00\" height=\"20.0\"", left + 45.0, top + 20.0);
        assert!(svg.contains(&bar), "{bar} is not in\n{svg}");
    }

    #[test]
    fn map_has_equal_scales() {
        let line = vec![[0.0, 0.0], [400.0, 10.0]];
        let map = Chart::map("", ["east, m", "north, m"], vec![Series::line("", COLORS[0], line)]);
        let scale = |axis: &Axis, side: f64| side / (axis.range[1] - axis.range[0]);
        assert!((scale(&map.x, map.size[0]) - scale(&map.y, map.size[1])).abs() < 0.01, "{map:?}");
        assert!(map.x.range[0] < 0.0 && map.x.range[1] > 400.0 && map.size[1] == MIN_MAP_SIDE);
    }

    #[test]
    fn names_are_escaped_and_listed_once() {
        let svg = chart().svg();
        assert_eq!(svg.matches("a &lt; b").count(), 1, "{svg}");
        assert!(svg.contains("T &amp; U") && !svg.contains("NaN"), "{svg}");
    }

    #[test]
    fn sheet_places_charts_in_a_grid() {
        let svg = sheet(&[chart(), chart(), chart()], 2);
        let [width, height] = draw::outer(&chart());
        for place in ["0 0".to_owned(), format!("{width} 0"), format!("0 {height}")] {
            assert!(svg.contains(&format!("translate({place})")), "{place}");
        }
    }
}
