//! Tables of IoU by class.

use crate::loss_table::{mean_and_deviation, min_and_max};
use messages::ClassId::{
    self, Building, Fence, Pedestrian, Pole, Road, RoadLine, Sidewalk, Static, Terrain, TrafficLight, TrafficSign,
    Vegetation, Vehicles, Wall,
};
use scores::Confusion;

/// All classes of table 6.8, and walls, which are frequent in the simulated towns.
pub const ALL: [ClassId; 14] = [
    Fence,
    Pedestrian,
    Pole,
    Vegetation,
    Vehicles,
    Wall,
    TrafficSign,
    TrafficLight,
    Static,
    Building,
    RoadLine,
    Road,
    Sidewalk,
    Terrain,
];
/// A variant of training: its name, its classes, and its confusion matrix for each seed.
pub type Column<'a> = (&'a str, &'a [ClassId], Vec<Confusion>);

/// Prints the IoU of each class in percent, as mean and range over the seeds. The last rows are the means over the classes of each
/// column and over the `shared` classes, and the overall accuracy.
pub fn print_iou_table(columns: &[Column<'_>], shared: &[ClassId]) {
    let names: Vec<&str> = columns.iter().map(|(name, ..)| *name).collect();
    println!("| class | {} |\n|---|{}", names.join(" | "), "---|".repeat(names.len()));
    let text = |values: &[f64]| {
        let percents: Vec<f64> = values.iter().map(|value| 100.0 * value).collect();
        let [least, largest] = min_and_max(&percents);
        format!("{:.1} ({least:.1} to {largest:.1})", mean_and_deviation(&percents).0)
    };
    let iou = |confusion: &Confusion, classes: &[ClassId], class: ClassId| {
        let index = classes.iter().position(|of| *of == class)?;
        confusion.class(index).iou.filter(|_| confusion.class(index).n_truth > 0)
    };
    let row = |name: &str, value: &dyn Fn(&Confusion, &[ClassId]) -> Option<f64>| {
        let cells = columns.iter().map(|(_, classes, confusions)| {
            let values: Option<Vec<f64>> = confusions.iter().map(|confusion| value(confusion, classes)).collect();
            values.map_or_else(|| "-".to_owned(), |values| text(&values))
        });
        println!("| {name} | {} |", cells.collect::<Vec<_>>().join(" | "));
    };
    for class in ALL {
        row(class.name(), &|confusion, classes| iou(confusion, classes, class));
    }
    row("mean of own classes", &|confusion, _| confusion.mean_iou());
    if shared.len() < ALL.len() {
        row(&format!("mean of {}", shared.len()), &|confusion, classes| {
            let ious: Vec<f64> = shared.iter().filter_map(|class| iou(confusion, classes, *class)).collect();
            (!ious.is_empty()).then(|| ious.iter().sum::<f64>() / ious.len() as f64)
        });
    }
    row("OA", &|confusion, _| confusion.overall_accuracy());
}
