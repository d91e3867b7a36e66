//! The page with verdicts, stamps and pictures.

use super::Picture;
use crate::check::Report;
use crate::survey::Survey;
use chart::escaped;
use formats::drive::Drive;
use std::fmt::Write;

const STYLE: &str = "body{font:14px sans-serif;margin:2em;max-width:1200px}table{border-collapse:collapse}td,th{border:1px solid \
                     #ccc;padding:3px 8px;text-align:left}.doubt{background:#fdd}.unknown{color:#777}img{max-width:100%}";

/// The page. Pictures are files beside it.
pub(super) fn html(drive: &Drive, survey: &Survey, report: &Report, pictures: &[Picture]) -> String {
    let name = escaped(&drive.manifest().name);
    let mut page = format!(
        "<!DOCTYPE html><meta charset=\"utf-8\"><title>Rig of {name}</title><style>{STYLE}</style><h1>{name}</h1>"
    );
    page.push_str("<h2>Verdicts</h2><table><tr><th>sensor<th>check<th>answer<th>value<th>limit<th>what to change");
    for verdict in &report.verdicts {
        let answer = verdict.answer.word();
        // Writing to a string cannot fail.
        let _ = write!(
            page,
            "<tr class=\"{}\"><td>{}<td>{}<td>{answer}<td>{}<td>{}<td>{}",
            answer.to_lowercase(),
            escaped(&verdict.subject),
            verdict.check,
            escaped(&verdict.value),
            escaped(&verdict.limit),
            escaped(&verdict.advice)
        );
    }
    page.push_str(
        "</table><h2>Stamps</h2><table><tr><th>sensor<th>number<th>first<th>last<th>interval, s<th>longest gap, s",
    );
    for sensor in &survey.stamps {
        let [first, last] =
            sensor.span.map_or(["-".to_owned(), "-".to_owned()], |span| span.map(|stamp| stamp.to_string()));
        let _ = write!(
            page,
            "<tr><td>{}<td>{}<td>{first}<td>{last}<td>{:.4}<td>{:.3}",
            escaped(&sensor.name),
            sensor.n,
            sensor.interval_s,
            sensor.gap_s
        );
    }
    page.push_str("</table><h2>Pictures</h2>");
    for picture in pictures {
        let _ = write!(page, "<p>{}<br><img src=\"{}\">", escaped(&picture.caption), picture.file);
    }
    page.push('\n');
    page
}
