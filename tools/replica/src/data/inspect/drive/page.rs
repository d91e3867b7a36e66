//! The report as one page without other files.

use super::DriveReport;
use super::pictures::timeline;
use super::stream::{Stream, seconds_between};
use super::text::{HEADINGS, gap_lines, row};
use chart::escaped;
use chart::{Axis, COLORS, Chart, Series};
use geometry::Stamp;
use std::fmt::Write;

const STYLE: &str = "body{font-family:sans-serif;max-width:1100px;margin:24px auto;padding:0 16px;color:#222}\
h1{font-size:22px}h2{font-size:17px;margin-top:28px}table{border-collapse:collapse;font-size:14px}\
td,th{padding:4px 10px;border-bottom:1px solid #ddd;text-align:right;white-space:nowrap}\
td:nth-child(-n+2),th:nth-child(-n+2){text-align:left}\
.doubts{background:#fff1e8;border-left:4px solid #d55e00;padding:8px 16px}\
.sound{background:#eaf6f1;border-left:4px solid #009e73;padding:8px 16px}\
figure{display:inline-block;margin:8px 12px 8px 0;vertical-align:top}\
figcaption{font-size:13px;color:#555;max-width:480px}img{max-width:100%}li{margin:3px 0}";
/// Rates of sensors on one chart differ by less than this factor.
const RATE_SPREAD: f64 = 3.0;

/// The page.
pub fn of(report: &DriveReport) -> String {
    let origin = report.lidar_span().map_or(Stamp(0), |[first, _]| first);
    let title = escaped(&format!("{} ({})", report.folder, report.name));
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title>\n<style>{STYLE}</style></head>\n\
         <body>\n<h1>{title}</h1>\n"
    );
    page.push_str(&doubts(&report.doubts));
    page.push_str(&table(&report.streams));
    let gaps: String = report.streams.iter().map(|stream| gap_lines(stream, origin)).collect();
    page.push_str(&list(gaps.lines().map(str::to_owned)));
    // Writing to a string cannot fail.
    let _ = write!(page, "<h2>Time of the sensors, gaps in orange</h2>\n{}", timeline(&report.streams, origin));
    page.push_str("<h2>First pictures</h2>\n");
    for picture in &report.pictures {
        let title = escaped(&picture.title);
        let uri = picture.data_uri();
        let _ = writeln!(page, "<figure><img src=\"{uri}\" alt=\"{title}\"><figcaption>{title}</figcaption></figure>");
    }
    let _ = writeln!(page, "<h2>Rates</h2>\n{}", rates(&report.streams, origin));
    if report.path_m.len() > 1 {
        let path = vec![Series::line("", COLORS[0], report.path_m.clone())];
        let _ = writeln!(page, "<h2>Path by GNSS</h2>\n{}", Chart::map("", ["east, m", "north, m"], path).svg());
    }
    for section in &report.sections {
        let _ = writeln!(page, "<h2>{}</h2>", escaped(&section.heading));
        page.push_str(&list(section.lines.iter().cloned()));
    }
    page + "</body></html>\n"
}

fn doubts(doubts: &[String]) -> String {
    if doubts.is_empty() {
        return "<p class=\"sound\">No doubts.</p>\n".to_owned();
    }
    format!("<div class=\"doubts\"><b>Doubts</b>{}</div>\n", list(doubts.iter().cloned()))
}

fn list(lines: impl Iterator<Item = String>) -> String {
    let items: Vec<String> = lines.map(|line| format!("<li>{}</li>\n", escaped(&line))).collect();
    if items.is_empty() { String::new() } else { format!("<ul>\n{}</ul>\n", items.concat()) }
}

fn table(streams: &[Stream]) -> String {
    let cells = |tag: &str, cells: &[String]| -> String {
        cells.iter().map(|cell| format!("<{tag}>{}</{tag}>", escaped(cell))).collect::<Vec<_>>().concat()
    };
    let mut text = format!("<h2>Sensors</h2>\n<table><tr>{}</tr>\n", cells("th", &HEADINGS.map(str::to_owned)));
    for stream in streams {
        let _ = writeln!(text, "<tr>{}</tr>", cells("td", &row(stream)));
    }
    text + "</table>\n"
}

/// One chart for all sensors of a similar rate.
fn rates(streams: &[Stream], origin: Stamp) -> String {
    let mut rated: Vec<(f64, &Stream)> = streams.iter().filter_map(|s| Some((s.rate_hz()?, s))).collect();
    rated.sort_by(|a, b| b.0.total_cmp(&a.0));
    let spans = || streams.iter().filter_map(Stream::span).flatten().map(|stamp| seconds_between(stamp, origin));
    let (begin, end) = (spans().fold(0.0, f64::min), spans().fold(1e-3, f64::max));
    let mut charts = Vec::new();
    while let Some((fastest, _)) = rated.first().copied() {
        let n_similar = rated.partition_point(|(rate, _)| *rate * RATE_SPREAD >= fastest);
        let mut series = Vec::new();
        for ((_, stream), color) in rated.drain(..n_similar).zip(COLORS.iter().cycle()) {
            series.push(Series::line(&stream.name, color, stream.rates(origin)));
        }
        let points = || series.iter().flat_map(Series::points);
        let x = Axis::new("s after the begin of the LiDAR", [begin, end]);
        let y = Axis::from_zero("messages per second", points().map(|[_, y]| *y));
        charts.push(Chart { size: [760.0, 150.0], ..Chart::new("", x, y, series) });
    }
    if charts.is_empty() { String::new() } else { chart::sheet(&charts, 1) }
}
