//! Instances in simulated towns with true poses, by true classes (what the method reaches at best) or by those of a model, and
//! what each setting is worth.
//!
//! ```sh
//! cargo run --release -p instance --example town_scores -- FOLDER urban,suburban 10 9301,9302
//! cargo run --release -p instance --example town_scores -- FOLDER urban,suburban 10 9301,9302 models/street.safetensors
//! ```
//!
//! Folder of the drives, kinds of towns, length of a drive in s, seeds, model. Drives that are not there are simulated, with
//! the lidar alone. The scores are those of `replica evaluate instances` over all submaps of a drive together, so an
//! object that changes its number at a border is missed and made up; then over all drives.

mod town;

use instance::{InstanceStage, Settings, Thing};
use messages::{CLASS_TABLE_VERSION, ClassHeader, ClassId, ClassRow, ClassTopic, InstanceTopic, SubmapTopic};
use scores::{InstanceScores, Overlaps, PointLabel};
use simulation::Town;
use stage::testing::{Bench, context};
use std::path::Path;
use town::TownSubmap;

/// Smaller true objects count for nobody: 100 returns of a drive are a car 60 m away.
const MIN_POINTS: u64 = 100;
const CLASSES: [ClassId; 2] = [ClassId::Vehicles, ClassId::Pedestrian];

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [folder, towns, seconds, seeds, model @ ..] = words.as_slice() else {
        panic!("usage: town_scores FOLDER TOWN,TOWN... SECONDS SEED,SEED... [MODEL]")
    };
    let seconds: f64 = seconds.parse().expect("seconds");
    let seeds: Vec<u64> = seeds.split(',').map(|seed| seed.parse().expect("a seed")).collect();
    let model = model.first().map(|path| {
        segmentation::load(Path::new(path), &segmentation::Options::default()).expect("the model can be read")
    });
    println!("| town | settings | class | true | found | SM % | PQ % | SQ % | RQ % | mIoU % |");
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let variants = variants();
    for town in towns.split(',') {
        let kind = Town::ALL.into_iter().find(|kind| kind.name() == town);
        let kind = kind.unwrap_or_else(|| panic!("{town:?} is no kind of town"));
        let mut pooled: Vec<Vec<InstanceScores>> = vec![Vec::new(); variants.len()];
        for &seed in &seeds {
            let submaps = town::submaps(Path::new(folder), kind, seed, seconds);
            let classes: Vec<Vec<ClassRow>> = submaps.iter().map(|submap| submap.classes(model.as_deref())).collect();
            for (pool, (_, settings)) in pooled.iter_mut().zip(&variants) {
                pool.extend(evaluate(&submaps, &classes, settings));
            }
        }
        for class in CLASSES {
            for ((name, _), scores) in variants.iter().zip(&pooled) {
                print(town, name, &together(class, scores));
            }
        }
    }
}

/// The thesis' rules, the default, and the default with one thing changed.
fn variants() -> Vec<(String, Settings)> {
    let of_class = |idx: usize, change: &dyn Fn(&mut Thing)| {
        let mut settings = Settings::default();
        change(&mut settings.things[idx]);
        settings
    };
    let mut thesis = Settings { apart_s: 0.0, remembered_submaps: 0, dilation_m: 0.2, ..Settings::default() };
    for (thing, min_points) in thesis.things.iter_mut().zip([500, 100]) {
        (thing.peak_m, thing.min_score, thing.min_points) = (0.0, 0.0, min_points);
    }
    let mut variants = vec![
        ("the thesis' rules".to_owned(), thesis),
        ("default".to_owned(), Settings::default()),
        ("remembered_submaps = 0".to_owned(), Settings { remembered_submaps: 0, ..Settings::default() }),
        ("apart_s = 0".to_owned(), Settings { apart_s: 0.0, ..Settings::default() }),
    ];
    for dilation_m in [0.1, 0.2, 0.3] {
        variants.push((format!("dilation_m = {dilation_m}"), Settings { dilation_m, ..Settings::default() }));
    }
    for (idx, name) in ["vehicles", "pedestrian"].into_iter().enumerate() {
        for peak_m in [0.0, 0.2, 0.4, 0.8] {
            variants.push((format!("{name}: peak_m = {peak_m}"), of_class(idx, &|thing| thing.peak_m = peak_m)));
        }
        for min_points in [[100, 200, 300, 500], [25, 50, 75, 100]][idx] {
            let change = |thing: &mut Thing| thing.min_points = min_points;
            variants.push((format!("{name}: min_points = {min_points}"), of_class(idx, &change)));
        }
        for min_score in [[0.7, 0.8, 0.9], [0.0, 0.4, 0.6]][idx] {
            let change = |thing: &mut Thing| thing.min_score = min_score;
            variants.push((format!("{name}: min_score = {min_score}"), of_class(idx, &change)));
        }
        let (join_m, max_length_m) = [(0.8, 6.0), (0.3, 1.2)][idx];
        let join = |thing: &mut Thing| (thing.join_m, thing.max_length_m) = (join_m, max_length_m);
        variants.push((format!("{name}: join_m = {join_m}, max_length_m = {max_length_m}"), of_class(idx, &join)));
    }
    variants
}

fn evaluate(submaps: &[TownSubmap], classes: &[Vec<ClassRow>], settings: &Settings) -> Vec<InstanceScores> {
    let mut bench = Bench::<InstanceStage>::new(settings, &context(Path::new("/nowhere"))).expect("builds");
    let mut overlaps = Overlaps::default();
    for (submap, classes) in submaps.iter().zip(classes) {
        bench.send::<SubmapTopic>(0, *submap.header, submap.points.clone());
        let header = ClassHeader { class_table_version: CLASS_TABLE_VERSION, model_digest: 0 };
        bench.send::<ClassTopic>(0, header, classes.clone());
        bench.tick().expect("steps");
        for column in bench.take::<InstanceTopic>() {
            for ((&instance, truth), row) in column.rows().iter().zip(&submap.truth).zip(classes) {
                let predicted = PointLabel { class: row.class_id, instance };
                overlaps.add(PointLabel { class: truth.class, instance: truth.instance.into() }, predicted);
            }
        }
    }
    CLASSES.map(|class| overlaps.score(class as u8, ClassId::Unlabeled as u8, MIN_POINTS)).into()
}

/// The scores of several drives as one.
fn together(class: ClassId, scores: &[InstanceScores]) -> InstanceScores {
    let of_class = || scores.iter().filter(|score| score.class == class as u8);
    InstanceScores {
        class: class as u8,
        n_true: of_class().map(|score| score.n_true).sum(),
        n_predicted: of_class().map(|score| score.n_predicted).sum(),
        matches: of_class().flat_map(|score| score.matches.clone()).collect(),
    }
}

fn print(town: &str, name: &str, score: &InstanceScores) {
    let percent = [score.sm(), score.pq(), score.sq(), score.rq(), score.miou()].map(|v| format!("{:.1}", 100.0 * v));
    let class = messages::class_name(score.class);
    let (n_true, n_found) = (score.n_true, score.n_predicted);
    println!("| {town} | {name} | {class} | {n_true} | {n_found} | {} |", percent.join(" | "));
}
