//! Vehicles and people of labeled real streets with boxes: how many the default finds.
//!
//! ```sh
//! cargo run --release -p studies --example street_boxes -- ../shared/data/street_labels models/street_fused.safetensors 20
//! ```
//!
//! Folder with one data set per subfolder (`PandaSet`, `SUSTechPOINTS`), model, and the points that a scored box has at least. Each sweep is
//! a submap of one sweep. A box has a *right class* if at least half of its points have its class, and is *found* if moreover one object of
//! this class has at least half of its points. An object is *false* if less than half of its points are in boxes of its class; objects with
//! half of their points in boxes of cyclists, riders and motorcycles are ignored.

mod boxes;
mod sweep;

use boxes::{Cuboid, Label};
use instance::{InstanceStage, Settings};
use messages::{
    CLASS_TABLE_VERSION, ClassHeader, ClassId, ClassRow, ClassTopic, InstanceTopic, SubmapHeader, SubmapPoint,
    SubmapTopic,
};
use segmentation::{ModelInput, Options, Segmenter};
use stage::testing::{Bench, context};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const CLASSES: [ClassId; 2] = [ClassId::Vehicles, ClassId::Pedestrian];

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [folder, model, min_points @ ..] = words.as_slice() else {
        panic!("usage: street_boxes FOLDER MODEL [POINTS]")
    };
    let min_points = min_points.first().map_or(20, |word| word.parse().expect("a number of points"));
    let model = segmentation::load(Path::new(model), &Options::default()).expect("the model can be read");
    println!("| data set | sweep | class | boxes | right class | found | objects | false |");
    println!("|---|---|---|---|---|---|---|---|");
    let mut totals = [Tally::default(); 2];
    for set in sorted(Path::new(folder)) {
        let name = set.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let sweeps: Vec<PathBuf> = if set.is_dir() { sorted(&set) } else { Vec::new() };
        if set.is_dir() && has_feathers(&set) {
            eprintln!("{name}: not scored: a feather is an Arrow file, and this program has no reader for it");
        }
        for path in sweeps {
            let Some(boxes) = boxes::read(&path) else { continue };
            let tallies = score(model.as_ref(), &sweep::read(&path), &boxes, min_points);
            for ((class, tally), total) in CLASSES.iter().zip(tallies).zip(&mut totals) {
                let stem = path.file_stem().unwrap_or_default().to_string_lossy();
                println!("| {name} | {stem} | {} | {} |", messages::class_name(*class as u8), tally.cells());
                total.add(tally);
            }
        }
    }
    for (class, total) in CLASSES.iter().zip(totals) {
        println!("| all | | {} | {} |", messages::class_name(*class as u8), total.cells());
    }
}

/// Numbers of boxes and objects of one class.
#[derive(Clone, Copy, Default)]
struct Tally {
    boxes: usize,
    right: usize,
    found: usize,
    objects: usize,
    false_objects: usize,
}

impl Tally {
    fn add(&mut self, other: Self) {
        self.boxes += other.boxes;
        self.right += other.right;
        self.found += other.found;
        self.objects += other.objects;
        self.false_objects += other.false_objects;
    }

    fn cells(&self) -> String {
        let Self { boxes, right, found, objects, false_objects } = self;
        format!("{boxes} | {right} | {found} | {objects} | {false_objects}")
    }
}

fn score(model: &dyn Segmenter, points: &[SubmapPoint], boxes: &[Cuboid], min_points: usize) -> [Tally; 2] {
    let header = SubmapHeader::one_sweep(points.len(), 0);
    let mut classes = vec![ClassRow::default(); points.len()];
    model.segment(&ModelInput::new(&header, points), &mut classes).expect("the model takes any cloud");
    let mut bench = Bench::<InstanceStage>::new(&Settings::default(), &context(Path::new("/nowhere"))).expect("builds");
    bench.send::<SubmapTopic>(0, *header, points.to_vec());
    let of_classes = ClassHeader { class_table_version: CLASS_TABLE_VERSION, model_digest: 0 };
    bench.send::<ClassTopic>(0, of_classes, classes.clone());
    bench.tick().expect("steps");
    let columns = bench.take::<InstanceTopic>();
    let ids = columns[0].rows();
    let box_of: Vec<Option<usize>> =
        points.iter().map(|p| boxes.iter().position(|cuboid| cuboid.contains([p.x, p.y, p.z]))).collect();
    CLASSES.map(|class| tally(class, boxes, &box_of, &classes, ids, min_points))
}

fn tally(
    class: ClassId,
    boxes: &[Cuboid],
    box_of: &[Option<usize>],
    classes: &[ClassRow],
    ids: &[u32],
    min_points: usize,
) -> Tally {
    let label = if class == ClassId::Vehicles { Label::Vehicle } else { Label::Person };
    let mut n_points = vec![0; boxes.len()];
    let mut n_right = n_points.clone();
    let mut of_id: BTreeMap<u32, [usize; 3]> = BTreeMap::new();
    let mut both: BTreeMap<(usize, u32), usize> = BTreeMap::new();
    for ((&in_box, row), &id) in box_of.iter().zip(classes).zip(ids) {
        let is_class = row.class_id == class as u8;
        if is_class && id != 0 {
            let [n, n_labeled, n_ignored] = of_id.entry(id).or_default();
            *n += 1;
            *n_labeled += usize::from(in_box.is_some_and(|found| boxes[found].label == label));
            *n_ignored += usize::from(in_box.is_some_and(|found| boxes[found].label == Label::Ignored));
        }
        let Some(found) = in_box else { continue };
        n_points[found] += 1;
        if is_class {
            n_right[found] += 1;
            if id != 0 {
                *both.entry((found, id)).or_default() += 1;
            }
        }
    }
    let scored = || (0..boxes.len()).filter(|&at| boxes[at].label == label && n_points[at] >= min_points.max(1));
    let is_right = |at: &usize| 2 * n_right[*at] >= n_points[*at];
    let is_found =
        |at: &usize| is_right(at) && both.iter().any(|((found, _), n)| found == at && 2 * n >= n_points[*at]);
    let counted = || of_id.values().filter(|[n, _, n_ignored]| 2 * n_ignored < *n);
    Tally {
        boxes: scored().count(),
        right: scored().filter(is_right).count(),
        found: scored().filter(is_found).count(),
        objects: counted().count(),
        false_objects: counted().filter(|[n, n_labeled, _]| 2 * n_labeled < *n).count(),
    }
}

fn sorted(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("is an entry").path()).collect();
    paths.sort();
    paths
}

fn has_feathers(folder: &Path) -> bool {
    let is_feather = |path: &Path| path.extension().is_some_and(|extension| extension == "feather");
    sorted(folder).iter().any(|path| is_feather(path) || (path.is_dir() && has_feathers(path)))
}
