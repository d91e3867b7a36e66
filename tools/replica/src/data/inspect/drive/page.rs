//! The report as one self-contained page.

use super::DriveReport;
use super::pictures::timeline;
use super::stream::{Stream, seconds_between};
use super::text::{HEADINGS, gap_lines, row};
use chart::{Axis, COLORS, Chart, Series};
use geometry::Stamp;
use page::{Level, Page, Table};

/// Rates of sensors on one chart differ by less than this factor.
const RATE_SPREAD: f64 = 3.0;

/// The page.
pub fn render(report: &DriveReport) -> String {
    let origin = report.origin();
    let mut page = Page::new(&format!("{} ({})", report.folder, report.name));
    if report.doubts.is_empty() {
        page.notice(Level::Green, "No doubts.", [""; 0]);
    } else {
        page.notice(Level::Amber, "Doubts", &report.doubts);
    }
    page.section("Sensors");
    add_sensors(&mut page, &report.streams, origin);
    page.section("First pictures");
    for picture in &report.pictures {
        page.picture(&picture.data_uri(), &picture.title);
    }
    page.section("Rates");
    page.drawing(&rates(&report.streams, origin), "");
    if report.path_m.len() > 1 {
        let path = vec![Series::line("", COLORS[0], report.path_m.clone())];
        page.section("Path by GNSS");
        page.drawing(&Chart::map("", ["east, m", "north, m"], path).svg(), "");
    }
    for section in &report.sections {
        page.section(&section.heading);
        page.list(&section.lines);
    }
    page.finish()
}

/// Table, gaps and timeline of the sensors.
pub fn add_sensors(page: &mut Page, streams: &[Stream], origin: Stamp) {
    let mut table = Table::new(&HEADINGS, 2);
    for stream in streams {
        table.row(row(stream));
    }
    page.table(&table.without_zero_columns());
    let gaps: String = streams.iter().map(|stream| gap_lines(stream, origin)).collect();
    page.list(gaps.lines());
    page.drawing(&timeline(streams, origin), "Time of the sensors, gaps in orange.");
}

/// One chart for all sensors of a similar rate.
fn rates(streams: &[Stream], origin: Stamp) -> String {
    let mut rated: Vec<(f64, &Stream)> = streams.iter().filter_map(|s| Some((s.rate_hz()?, s))).collect();
    rated.sort_by(|a, b| b.0.total_cmp(&a.0));
    let spans = || streams.iter().filter_map(Stream::span).flatten().map(|stamp| seconds_between(stamp, origin));
    let begin = spans().fold(0.0, f64::min);
    let end = spans().fold(1e-3, f64::max);
    let mut charts = Vec::new();
    while let Some((fastest, _)) = rated.first().copied() {
        let n_similar = rated.partition_point(|(rate, _)| *rate * RATE_SPREAD >= fastest);
        let mut series = Vec::new();
        for ((_, stream), color) in rated.drain(..n_similar).zip(COLORS.iter().cycle()) {
            series.push(Series::line(&stream.name, color, stream.rates(origin)));
        }
        let points = || series.iter().flat_map(Series::points);
        let x = Axis::new("s after the start of the LiDAR", [begin, end]);
        let y = Axis::from_zero("messages per second", points().map(|[_, y]| *y));
        charts.push(Chart { size: [760.0, 150.0], ..Chart::new("", x, y, series) });
    }
    if charts.is_empty() { String::new() } else { chart::sheet(&charts, 1) }
}
