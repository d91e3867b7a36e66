//! The start of the page: what a client asks first. Picture and map, date, place, length, area, accuracy in words.

use super::cloud_survey::CloudSurvey;
use super::facts::Facts;
use super::finished_run::FinishedRun;
use super::material::Material;
use super::view_drawing;
use crate::data::inspect::drive::pictures::png;
use files::calendar::text_of_nanos;
use image::RgbImage;
use page::{Page, Table, grouped};

/// Below the picture by color.
pub const GRAY: &str = "Gray by intensity where no camera saw the point.";

/// A top view of the report.
pub struct ShownView<'a> {
    /// Its number: by color, by class, by instance.
    pub index: usize,
    picture: &'a RgbImage,
}

/// The first top view that has a picture.
pub fn view(survey: &CloudSurvey) -> Option<ShownView<'_>> {
    let mut views = survey.views.iter().enumerate();
    views.find_map(|(index, view)| Some(ShownView { index, picture: view.as_ref()? }))
}

/// Writes the table, the picture and the map.
pub fn add(page: &mut Page, run: &FinishedRun, facts: &Facts, material: &Material) {
    let mut table = Table::new(&["", ""], 2);
    for Row { name, text } in rows(run, facts) {
        table.row([name.to_owned(), text]);
    }
    page.table(&table);
    let mut drawings = Vec::new();
    if let Some(survey) = &material.survey
        && let Some(ShownView { index, picture }) = view(survey)
        && let Some(encoded) = png(String::new(), picture)
    {
        let caption =
            ["The street from above. ", "The street from above, by class.", "The street from above, by instance."];
        let gray = if index == 0 { GRAY } else { "" };
        let svg = view_drawing::drawing(picture, &encoded.data_uri(), survey.scale, run.has_north());
        drawings.push((svg, format!("{}{gray}", caption.get(index).unwrap_or(&""))));
    }
    if let Some(place) = &facts.path {
        let of_fixes = if place.fixes.is_some() { ", and lines from the fixes to the antenna on the path" } else { "" };
        drawings.push((place.map(), format!("Path of the vehicle{of_fixes}.")));
    }
    page.drawings(drawings.iter().map(|(svg, caption)| (svg.as_str(), caption.as_str())));
}

/// A row of the table.
struct Row {
    name: &'static str,
    text: String,
}

fn rows(run: &FinishedRun, facts: &Facts) -> Vec<Row> {
    let mut rows = Vec::new();
    let mut add = |name: &'static str, text: Option<String>| rows.extend(text.map(|text| Row { name, text }));
    let stamps = run.index.iter().flat_map(|index| &index.clouds);
    let begin = stamps.map(|cloud| cloud.stamp_begin).min();
    add("Date", begin.map(|nanos| text_of_nanos(nanos).split('.').next().unwrap_or_default().to_owned() + " UTC"));
    let origin = run.georeference.as_ref().and_then(|found| found.origin);
    add(
        "Place",
        origin.map(|origin| format!("latitude {:.5}, longitude {:.5}", origin.latitude_deg, origin.longitude_deg)),
    );
    add(
        "Street",
        facts.path.as_ref().map(|path| {
            let area = facts.points.area_m2.map(|area| format!(", {} m² of ground", grouped(area as u64)));
            format!("{:.0} m in {:.0} s{}", path.length_m, path.seconds, area.unwrap_or_default())
        }),
    );
    add("Points", Some(grouped(facts.points.n)));
    add("Objects", (facts.n_objects > 0).then(|| format!("{} vehicles and people", facts.n_objects)));
    add("Accuracy", Some(facts.accuracy.in_words()));
    rows
}
