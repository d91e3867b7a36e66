//! The page with verdicts, stamps and pictures.

use super::Picture;
use crate::check::Report;
use crate::survey::Survey;
use drive::Drive;
use page::{Level, Page, Table};

/// Builds the page. Pictures are files in the same folder.
pub(super) fn html(drive: &Drive, survey: &Survey, report: &Report, pictures: &[Picture]) -> String {
    let mut page = Page::new(&format!("Rig of {}", drive.manifest().name));
    page.section("Verdicts");
    let mut verdicts = Table::new(&["sensor", "check", "answer", "value", "limit", "what to change"], 6);
    for verdict in &report.verdicts {
        let answer = verdict.answer.word();
        let cells = [&verdict.subject, verdict.check, answer, &verdict.value, &verdict.limit, &verdict.advice]
            .map(str::to_owned);
        if verdict.is_doubt() { verdicts.row_of(Level::Amber, cells) } else { verdicts.row(cells) }
    }
    page.table(&verdicts);
    page.section("Stamps");
    let mut stamps = Table::new(&["sensor", "number", "first", "last", "interval, s", "longest gap, s"], 1);
    for sensor in &survey.stamps {
        let [first, last] =
            sensor.span.map_or(["-".to_owned(), "-".to_owned()], |span| span.map(|stamp| stamp.to_string()));
        let [interval, gap] = [format!("{:.4}", sensor.interval_s), format!("{:.3}", sensor.gap_s)];
        stamps.row([sensor.name.clone(), sensor.n.to_string(), first, last, interval, gap]);
    }
    page.table(&stamps);
    page.section("Pictures");
    for picture in pictures {
        page.picture(&picture.file, &picture.caption);
    }
    page.finish()
}
