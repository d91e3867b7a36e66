//! The sections of the page, in their order.

use super::facts::Facts;
use super::finished_run::FinishedRun;
use super::material::Material;
use super::uncertain::CameraShare;
use super::{costs, overlays, overview, range_picture, uncertain, view_drawing};
use crate::data::inspect::drive::page::add_sensors;
use crate::data::inspect::drive::pictures::png;
use chart::{BarRow, bars};
use files::regular_file;
use messages::{ClassId, class_name};
use page::{Level, Page, Table, grouped};
use pictures::class_color::class_color;
use pictures::cost_history::CostHistory;

/// Objects in the table.
const MAX_OBJECTS: usize = 25;
/// Sections of the drive report that the page repeats.
const OF_DRIVE: [&str; 4] = ["Clocks", "GNSS", "IMU", "LiDAR"];

/// The whole page.
pub fn page(run: &FinishedRun, facts: &Facts, material: &Material) -> String {
    let mut page = Page::new(&format!("Run {}", run.folder.display()));
    overview::add(&mut page, run, facts, material);
    accuracy(&mut page, facts);
    verdict(&mut page, facts);
    page.contents();
    input(&mut page, facts, material);
    path(&mut page, facts, material);
    views(&mut page, run, facts, material);
    cameras(&mut page, material);
    reflectances(&mut page, facts, material);
    classes(&mut page, facts);
    objects(&mut page, facts);
    uncertainty(&mut page, run, facts);
    timings(&mut page, run, facts);
    repeat(&mut page, run, facts);
    page.finish()
}

fn accuracy(page: &mut Page, facts: &Facts) {
    for line in facts.accuracy.lines() {
        page.notice(line.level, &line.text, [""; 0]);
    }
}

fn verdict(page: &mut Page, facts: &Facts) {
    let verdict = &facts.verdict;
    let title = format!("{}. Exit code {}.", verdict.title(), verdict.exit_code);
    page.notice(verdict.level, &title, [""; 0]);
    let mut table = Table::new(&["", ""], 2);
    for finding in &verdict.findings {
        table.row_of(finding.level, [finding.subject.to_owned(), finding.text.clone()]);
    }
    page.table(&table);
}

fn input(page: &mut Page, facts: &Facts, material: &Material) {
    page.section("Input");
    let (Some(input), Some(drive)) = (&facts.input, &material.drive_report) else {
        page.paragraph("The drive folder can no longer be read, so its sensors are not listed.");
        return;
    };
    page.paragraph(&format!("{} ({})", input.drive.display(), input.name));
    add_sensors(page, &drive.streams, drive.origin());
    for section in drive.sections.iter().filter(|section| OF_DRIVE.contains(&section.heading.as_str())) {
        page.subsection(&section.heading);
        page.list(&section.lines);
    }
    if !input.remarks.is_empty() {
        page.notice(Level::Amber, "Remarks about the recording", &input.remarks);
    }
}

fn path(page: &mut Page, facts: &Facts, material: &Material) {
    page.section("Path");
    let Some(place) = &facts.path else {
        page.paragraph("There is no trajectory.");
        return;
    };
    let mut lines = vec![format!("{:.1} m in {:.1} s", place.length_m, place.seconds)];
    if let Some(georeference) = &facts.georeference {
        lines.push(format!("frame: {}", georeference.frame));
        let fixes = &georeference.fixes;
        let loops = &georeference.closed_loops;
        lines.push(format!(
            "{} fixes used, {} refused; {} loop closures used, {} refused",
            fixes.used, fixes.refused, loops.used, loops.refused
        ));
    }
    if let Some(area_m2) = facts.points.area_m2 {
        let density = facts.points.n as f64 / area_m2.max(1.0);
        lines.push(format!(
            "covered ground: {} m² in cells of 1 m, {density:.0} points per m²",
            grouped(area_m2 as u64)
        ));
    }
    page.list(lines);
    match &place.fixes {
        Some(fixes) => {
            let headings = ["fixes compared", "east", "north", "up", "horizontal, median", "largest"];
            let mut table = Table::new(&headings, 0);
            let m = |value: f64| format!("{value:.2} m");
            let up = fixes.rms_up_m.map_or("-".to_owned(), m);
            let [median, largest] = [fixes.median_horizontal_m, fixes.largest_horizontal_m].map(m);
            table.row([fixes.n.to_string(), m(fixes.rms_east_m), m(fixes.rms_north_m), up, median, largest]);
            page.table(&table);
            page.remark(
                "Root mean square of path minus fix, by axis, including fixes that the run refused. These differences include the errors of \
                 the fixes themselves; lasting errors of the fixes are also in the path and do not show.",
            );
        }
        None if material.drive_report.is_some() => page.remark("No fix can be compared with the path."),
        None => {}
    }
}

fn views(page: &mut Page, run: &FinishedRun, facts: &Facts, material: &Material) {
    let Some(survey) = &material.survey else { return };
    page.section("Top views");
    let titles = ["By color", "By class", "By instance"];
    for ((title, view), index) in titles.iter().zip(&survey.views).zip(0..) {
        let Some(view) = view else {
            page.remark(&format!("{title}: no point has one."));
            continue;
        };
        let Some(picture) = png(String::new(), view) else { continue };
        // The first view with a picture stands at the start of the page.
        if overview::view(survey).is_some_and(|shown| shown.index == index) {
            continue;
        }
        page.subsection(title);
        page.drawing(&view_drawing::drawing(view, &picture.data_uri(), survey.scale, run.has_north()), "");
        match index {
            0 => page.remark(overview::GRAY),
            1 => page.legend(class_legend(facts)),
            _ => page.remark("Each instance has a color; points without one are gray."),
        }
    }
    if survey.step > 1 {
        page.remark(&format!("One of {} points is drawn.", survey.step));
    }
    if !run.has_north() {
        page.remark("The frame is local: up is not north.");
    }
}

/// Colors of the classes that occur, the most frequent first.
fn class_legend(facts: &Facts) -> impl Iterator<Item = (String, String)> {
    by_share(facts).into_iter().map(|class| (color_of(class.name), class.name.to_owned()))
}

fn color_of(class: &str) -> String {
    let id = (0..ClassId::ALL.len() as u8).find(|id| class_name(*id) == class).unwrap_or(u8::MAX);
    let [r, g, b] = class_color(id);
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Number of points of a class.
struct ClassCount<'a> {
    name: &'a str,
    n: u64,
}

fn by_share(facts: &Facts) -> Vec<ClassCount<'_>> {
    let counts = facts.points.classes.iter().map(|(name, n)| ClassCount { name, n: *n });
    let mut classes: Vec<ClassCount<'_>> = counts.collect();
    classes.sort_by_key(|class| std::cmp::Reverse(class.n));
    classes
}

fn cameras(page: &mut Page, material: &Material) {
    page.section("Calibration");
    if material.overlays.is_empty() {
        page.paragraph(material.without_overlays);
    } else {
        page.paragraph(&overlays::legend());
        page.pictures(material.overlays.iter().map(|picture| (picture.data_uri(), picture.title.clone())));
    }
    if let Some(picture) = &material.range_picture {
        let [near, far] = range_picture::RANGE_M;
        let caption = format!(
            "Range image of one revolution: a row for each ring, a column for each azimuth. Yellow {near} m, dark {far} m, black: \
             no return."
        );
        page.picture(&picture.data_uri(), &caption);
    }
}

fn reflectances(page: &mut Page, facts: &Facts, material: &Material) {
    let Some(charts) = &material.band_charts else { return };
    page.section("Reflectances");
    for diagnosis in &facts.diagnosis {
        page.list([format!("{}: {}", diagnosis.camera, diagnosis.findings.join("; "))]);
    }
    for chart in charts {
        page.drawing(chart, "");
    }
    page.remark("Reflectances of the points that a mosaic camera saw. `replica-lab spectrum DRIVE` shows the reflectances of its images.");
}

fn classes(page: &mut Page, facts: &Facts) {
    let classes = by_share(facts);
    let n_all: u64 = classes.iter().map(|class| class.n).sum();
    if n_all == 0 {
        return;
    }
    page.section("Classes");
    let share = |n: u64| n as f64 / n_all as f64;
    let largest = classes.first().map_or(1.0, |class| share(class.n));
    let rows: Vec<BarRow> = classes
        .iter()
        .map(|class| BarRow {
            name: class.name.to_owned(),
            pieces: vec![([0.0, share(class.n)], color_of(class.name))],
            text: format!("{:.2} %", 100.0 * share(class.n)),
        })
        .collect();
    page.drawing(&bars(&rows, [0.0, largest], ["", ""]), "Share of the points.");
}

fn objects(page: &mut Page, facts: &Facts) {
    if facts.objects.is_empty() {
        return;
    }
    page.section("Instances");
    let headings = ["instance", "class", "points", "x, m", "y, m", "length, m", "width, m", "height, m"];
    let mut table = Table::new(&headings, 2);
    for object in facts.objects.iter().take(MAX_OBJECTS) {
        let m = |value: f64| format!("{value:.2}");
        let [x, y, _] = object.position_m;
        let [length, width, height] = object.size_m.map(m);
        let id = object.id.to_string();
        let class = object.class.to_owned();
        table.row([id, class, grouped(object.points), m(x), m(y), length, width, height]);
    }
    page.table(&table);
    let n_more = facts.n_objects.saturating_sub(table.len());
    let more = if n_more > 0 { format!("{n_more} more. ") } else { String::new() };
    let command = format!("replica instances {}", facts.run.display());
    page.remark(&format!("{more}Numbers and sizes are from the points that were drawn; `{command}` reads all points."));
}

fn uncertainty(page: &mut Page, run: &FinishedRun, facts: &Facts) {
    page.section("Uncertainty");
    let doubts = facts.doubts.iter().map(|doubt| format!("{}: {}", doubt.stage, doubt.doubt.text));
    let doubts: Vec<String> = doubts.collect();
    if doubts.is_empty() {
        page.paragraph("No stage doubts its results.");
    } else {
        page.notice(Level::Amber, "Doubts", doubts);
        page.remark("docs/reference/doubts.md explains each doubt and its remedy.");
    }
    if let Some(chart) = uncertain::deviations(run) {
        let against = if run.has_north() { "on the earth" } else { "against the first submap" };
        page.drawing(&chart, &format!("Standard deviations of the submaps {against}, over the drive."));
    }
    if !facts.colored_by.is_empty() {
        let row = |share: &CameraShare| BarRow {
            name: share.camera.clone(),
            pieces: vec![([0.0, share.share], chart::COLORS[0].to_owned())],
            text: format!("{:.1} %", 100.0 * share.share),
        };
        let rows: Vec<BarRow> = facts.colored_by.iter().map(row).collect();
        page.drawing(&bars(&rows, [0.0, 1.0], ["", ""]), "Share of the points that each camera colored.");
    }
    if facts.losses.is_empty() {
        page.paragraph("No counter reports lost, damaged or skipped data.");
    } else {
        let mut table = Table::new(&["stage", "counter", "number"], 2);
        for loss in &facts.losses {
            table.row([loss.stage.clone(), loss.counter.clone(), grouped(loss.n)]);
        }
        page.table(&table);
    }
    for (topic, n) in &facts.total.dropped {
        page.paragraph(&format!("{n} messages of {topic} were dropped."));
    }
    for (stage, notes) in &facts.notes {
        page.list(notes.iter().map(|note| format!("{stage}: {note}")));
    }
}

fn timings(page: &mut Page, run: &FinishedRun, facts: &Facts) {
    page.section("Time and memory");
    let total = &facts.total;
    page.paragraph(&format!(
        "{:.1} s of drive in {:.1} s ({:.2} times real time), {:.1} s of CPU time, {:.0} MB of shared memory at most, {} restarts.",
        total.drive_s,
        total.wall_s,
        total.times_real_time,
        total.cpu_s,
        total.peak_shared_memory_bytes as f64 * 1e-6,
        total.restarts
    ));
    page.legend(costs::legend());
    page.drawing(&costs::bars(&run.summary), "Time of the main thread of each stage.");
    let mut table = Table::new(&["stage", "CPU, s", "working, s", "longest step, ms", "own memory, MB", "faults"], 1);
    for stage in &facts.stages {
        let numbers = [stage.cpu_s, stage.working_s].map(|s| format!("{s:.2}"));
        let [cpu, working] = numbers;
        let memory = format!("{:.0}", stage.peak_private_bytes as f64 * 1e-6);
        let longest = format!("{:.1}", stage.longest_step_ms);
        table.row([stage.name.clone(), cpu, working, longest, memory, stage.faults.to_string()]);
    }
    page.table(&table.without_zero_columns());
    // Live runs keep no history.
    if let Ok(Some(history)) = CostHistory::read(&run.folder) {
        page.drawing(&history.svg(), "");
    }
    if !facts.faults.is_empty() {
        page.notice(Level::Amber, "Faults", &facts.faults);
    }
}

fn repeat(page: &mut Page, run: &FinishedRun, facts: &Facts) {
    page.section("Repeat the run");
    let settings = &facts.settings;
    let Some(command) = &settings.command else {
        page.paragraph("run/settings.json is missing.");
        return;
    };
    page.command(command);
    for swap in &settings.swaps {
        page.paragraph(&format!("Swapped during the run: {}", swap.join(", ")));
    }
    if let Ok(text) = regular_file::read_to_string(run.folder.join("run/launch.toml")) {
        page.details("launch.toml", &text);
    }
    let digests = settings.digests.iter().map(|(path, digest)| format!("{digest}  {}", path.display()));
    page.details("Checksums of programs, models and settings", &digests.collect::<Vec<_>>().join("\n"));
    page.remark(&format!("Report by replica {}.", facts.replica_version));
}
