//! Instances in simulated towns and the effect of each setting: with true poses and true classes (a bound of the method), with
//! true poses and the classes of a model, or with the poses and classes of recorded runs.
//!
//! ```sh
//! cargo run --release -p studies --example town_scores -- FOLDER urban,suburban 10 9401,9402
//! cargo run --release -p studies --example town_scores -- FOLDER urban,suburban 10 9401,9402 models/street.safetensors
//! cargo run --release -p studies --example town_scores -- FOLDER urban,suburban 10 9401,9402 RECORDINGS [true]
//! ```
//!
//! Folder of the drives, kinds of towns, length of a drive in s, seeds, then a model or a folder of recordings. Missing
//! drives are simulated as `TOWN_SEED_SECONDS`, with only the lidar. The recording of a drive is `TOWN_SEED_SECONDS.mcap` with
//! the topics submap and class; `true` replaces its classes by the true ones. The scores are as in `replica-lab evaluate
//! instances` over all submaps of a drive together, so an object that changes its number at a border is a miss and a false
//! positive; then over all drives.

mod recorded;
mod town;

use instance::{InstanceStage, Settings, Thing};
use messages::{CLASS_TABLE_VERSION, ClassHeader, ClassId, ClassRow, ClassTopic, InstanceTopic, SubmapTopic};
use scores::{InstanceScores, Overlaps, PointLabel};
use simulation::Town;
use stage::testing::{Bench, context};
use std::path::Path;
use town::TownSubmap;

/// Smaller true objects are ignored: 100 returns of a drive are a car 60 m away.
const MIN_POINTS: u64 = 100;
/// Share of ground around an object by the rule of the thesis.
const MIN_GROUND_AROUND: f64 = 0.1;
const CLASSES: [ClassId; 2] = [ClassId::Vehicles, ClassId::Pedestrian];

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [folder, towns, seconds, seeds, model_words @ ..] = words.as_slice() else {
        panic!("usage: town_scores FOLDER TOWN,TOWN... SECONDS SEED,SEED... [MODEL]")
    };
    let seconds: f64 = seconds.parse().expect("seconds");
    let seeds: Vec<u64> = seeds.split(',').map(|seed| seed.parse().expect("a seed")).collect();
    let source = model_words.first().map(Path::new);
    let recordings = source.filter(|path| path.is_dir());
    let model = source
        .filter(|path| path.is_file())
        .map(|path| segmentation::load(path, &segmentation::Options::default()).expect("the model can be read"));
    let with_true_classes = model_words.get(1).is_some_and(|word| word == "true");
    println!("| town | settings | class | true | found | SM % | PQ % | SQ % | RQ % | mIoU % |");
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let variants = variants();
    for town in towns.split(',') {
        let kind: Town = town.parse().unwrap_or_else(|_| panic!("{town:?} is not a kind of town"));
        let mut pooled: Vec<Vec<InstanceScores>> = vec![Vec::new(); variants.len()];
        let mut bound: Vec<InstanceScores> = Vec::new();
        for &seed in &seeds {
            let name = format!("{town}_{seed}_{seconds}");
            let drive = Path::new(folder).join(&name);
            let (submaps, mut classes) = match recordings {
                Some(recordings) => recorded::submaps(&drive, &recordings.join(format!("{name}.mcap"))),
                None => (town::submaps(&drive, kind, seed, seconds), Vec::new()),
            };
            if recordings.is_none() || with_true_classes {
                classes = submaps.iter().map(|submap| submap.classes(model.as_deref())).collect();
            }
            bound.extend(bound_by_classes(&submaps, &classes));
            for (pool, (_, settings)) in pooled.iter_mut().zip(&variants) {
                pool.extend(evaluate(&submaps, &classes, settings));
            }
        }
        for class in CLASSES {
            for ((name, _), scores) in variants.iter().zip(&pooled) {
                print(town, name, &together(class, scores));
            }
            print(town, "bound by the classes", &together(class, &bound));
        }
    }
}

/// The thesis' rules, the default, and the default with one thing changed.
fn variants() -> Vec<(String, Settings)> {
    let of_all = |change: &dyn Fn(&mut Thing)| {
        let mut settings = Settings::default();
        settings.things.iter_mut().for_each(change);
        settings
    };
    let mut thesis = of_all(&|thing| {
        thing.peak_m = 0.0;
        thing.min_score = 0.0;
        thing.min_share = 0.0;
        thing.max_speed_mps = 0.0;
        thing.join_m = 0.0;
    });
    thesis.apart_s = 0.0;
    thesis.remembered_submaps = 0;
    thesis.min_ground_around = MIN_GROUND_AROUND;
    let fixed_counts = |thing: &mut Thing| {
        thing.min_share = 0.0;
        thing.max_speed_mps = 0.0;
        thing.join_m = 0.0;
        thing.min_score = if thing.class == ClassId::Vehicles.name() { 0.0 } else { 0.5 };
    };
    let with_ground = |settings: Settings| Settings { min_ground_around: MIN_GROUND_AROUND, ..settings };
    let mut variants = vec![
        ("the thesis' rules".to_owned(), thesis),
        ("fixed counts, no tracks, no joining".to_owned(), with_ground(of_all(&fixed_counts))),
        ("default".to_owned(), Settings::default()),
        (format!("min_ground_around = {MIN_GROUND_AROUND}"), with_ground(Settings::default())),
        ("max_speed_mps = 0".to_owned(), of_all(&|thing| thing.max_speed_mps = 0.0)),
        ("join_m = 0".to_owned(), of_all(&|thing| thing.join_m = 0.0)),
    ];
    for min_share in [0.0, 0.1, 0.2] {
        variants.push((format!("min_share = {min_share}"), of_all(&|thing| thing.min_share = min_share)));
    }
    for min_score in [0.0, 0.4, 0.5, 0.6, 0.7] {
        variants.push((format!("min_score = {min_score}"), of_all(&|thing| thing.min_score = min_score)));
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

/// The best scores that these classes allow: each point of the right class has its true instance, and all instances without a match are
/// left out.
fn bound_by_classes(submaps: &[TownSubmap], classes: &[Vec<ClassRow>]) -> Vec<InstanceScores> {
    let mut overlaps = Overlaps::default();
    for (submap, classes) in submaps.iter().zip(classes) {
        for (truth, row) in submap.truth.iter().zip(classes) {
            let truth = PointLabel { class: truth.class, instance: truth.instance.into() };
            let instance = if truth.class == row.class_id { truth.instance } else { 0 };
            overlaps.add(truth, PointLabel { class: row.class_id, instance });
        }
    }
    let best = |class: ClassId| {
        let score = overlaps.score(class as u8, ClassId::Unlabeled as u8, MIN_POINTS);
        InstanceScores { n_predicted: score.matches.len(), ..score }
    };
    CLASSES.map(best).into()
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
    let n_true = score.n_true;
    let n_found = score.n_predicted;
    println!("| {town} | {name} | {class} | {n_true} | {n_found} | {} |", percent.join(" | "));
}
