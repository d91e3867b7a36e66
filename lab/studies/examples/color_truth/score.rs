//! Scores by range and by class, printed as tables.

use messages::ClassId;
use std::collections::BTreeMap;

/// Upper ends of the ranges, m.
pub const RANGES_M: [f64; 4] = [5.0, 10.0, 20.0, 80.0];

/// Counts and values of the points in a span of ranges.
#[derive(Clone, Debug, Default)]
pub struct Score {
    /// Points that are truly visible in an exposure, and how many of them have a color.
    pub visible: usize,
    pub visible_colored: usize,
    /// Visible and colored points on a single surface that is not foliage.
    pub solid: usize,
    pub solid_colored: usize,
    pub colored: usize,
    /// Points with the color of an exposure from which they are occluded, by a solid object or by leaves.
    pub behind_solid: usize,
    pub behind_leaves: usize,
    /// Points whose pixel shows the sky.
    pub of_sky: usize,
    /// Differences between the colors and the pixel at the true projection.
    pub color_differences: Vec<f64>,
    /// Spectral angles to the cell at the true projection, and to the material in the sun and in the shade, rad.
    pub angles_to_cell: Vec<f64>,
    pub angles_to_material: [Vec<f64>; 2],
}

impl Score {
    pub fn add(&mut self, other: Self) {
        self.visible += other.visible;
        self.visible_colored += other.visible_colored;
        self.solid += other.solid;
        self.solid_colored += other.solid_colored;
        self.colored += other.colored;
        self.behind_solid += other.behind_solid;
        self.behind_leaves += other.behind_leaves;
        self.of_sky += other.of_sky;
        self.color_differences.extend(other.color_differences);
        self.angles_to_cell.extend(other.angles_to_cell);
        let [sun, shade] = other.angles_to_material;
        self.angles_to_material[0].extend(sun);
        self.angles_to_material[1].extend(shade);
    }
}

/// Scores by range and, of points on a single surface, by class.
#[derive(Clone, Debug, Default)]
pub struct Table {
    by_range: [Score; RANGES_M.len()],
    by_class: BTreeMap<ClassId, Score>,
}

impl Table {
    /// Adds the score of one point, if it is within the ranges.
    pub fn add_point(&mut self, range_m: f64, class: Option<ClassId>, score: Score) {
        let Some(place) = RANGES_M.iter().position(|end| range_m < *end) else { return };
        if let Some(class) = class {
            self.by_class.entry(class).or_default().add(score.clone());
        }
        self.by_range[place].add(score);
    }
}

pub fn sum(mut a: Table, b: Table) -> Table {
    a.by_range.iter_mut().zip(b.by_range).for_each(|(a, b)| a.add(b));
    b.by_class.into_iter().for_each(|(class, score)| a.by_class.entry(class).or_default().add(score));
    a
}

/// Share of `n` in `of`, %.
fn share(n: usize, of: usize) -> f64 {
    100.0 * n as f64 / of.max(1) as f64
}

/// The rows of the ranges, and a row for all points.
fn rows(table: &Table) -> impl Iterator<Item = (String, Score)> {
    let mut all = Score::default();
    for score in &table.by_range {
        all.add(score.clone());
    }
    let ranges = table.by_range.iter().zip(RANGES_M).map(|(score, end)| (format!("up to {end} m"), score.clone()));
    ranges.chain([("all".to_owned(), all)])
}

pub fn print_occlusion(title: &str, table: &Table) {
    println!(
        "{title}\n| range | visible points | of these colored | of solid ones | occluded by a solid object | by leaves |"
    );
    for (name, score) in rows(table) {
        println!(
            "| {name} | {} | {:.1} % | {:.1} % | {:.2} % | {:.2} % |",
            score.visible,
            share(score.visible_colored, score.visible),
            share(score.solid_colored, score.solid),
            share(score.behind_solid, score.colored),
            share(score.behind_leaves, score.colored)
        );
    }
}

pub fn print_colors(title: &str, table: &Table) {
    println!("{title}\n| range | colors | dE: median | 90 % below | above 10 |");
    for (name, score) in rows(table) {
        let [half, most] = [0.5, 0.9].map(|share| quantile(&score.color_differences, share));
        let n_far = score.color_differences.iter().filter(|difference| **difference > 10.0).count();
        let n = score.color_differences.len();
        println!("| {name} | {n} | {half:.1} | {most:.1} | {:.1} % |", 100.0 * n_far as f64 / n.max(1) as f64);
    }
}

pub fn print_classes(title: &str, table: &Table) {
    println!(
        "{title}\n| class | colored points | of the visible ones colored | occluded by a solid object | by leaves | of the sky | dE: median | 90 % below |"
    );
    for (class, score) in &table.by_class {
        let [half, most] = [0.5, 0.9].map(|share| quantile(&score.color_differences, share));
        println!(
            "| {} | {} | {:.1} % | {:.2} % | {:.2} % | {:.2} % | {half:.1} | {most:.1} |",
            class.name(),
            score.colored,
            share(score.visible_colored, score.visible),
            share(score.behind_solid, score.colored),
            share(score.behind_leaves, score.colored),
            share(score.of_sky, score.colored)
        );
    }
}

pub fn print_spectra(title: &str, table: &Table) {
    println!(
        "{title}\n| range | spectra | to the cell: median | 90 % below | to the material, sun: median | 90 % below | shade: median | 90 % below |"
    );
    for (name, score) in rows(table) {
        let [sun, shade] = &score.angles_to_material;
        let pair = |angles: &[f64]| format!("{:.3} | {:.3}", quantile(angles, 0.5), quantile(angles, 0.9));
        let n = score.angles_to_cell.len();
        println!("| {name} | {n} | {} | {} | {} |", pair(&score.angles_to_cell), pair(sun), pair(shade));
    }
}

/// NaN if there are no values.
fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted
        .get(((sorted.len() as f64 * share) as usize).min(sorted.len().saturating_sub(1)))
        .copied()
        .unwrap_or(f64::NAN)
}
