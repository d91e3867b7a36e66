//! Shapes of regions.

use super::LabelImage;
use std::f64::consts::PI;

/// Shapes of the regions of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shapes {
    /// Ratio of the area to the area of the bounding box, mean over regions.
    pub extent: f64,
    /// Ratio of the area to the number of pixels in the convex hull, mean over regions. The hull encloses the midpoints
    /// of the pixels' sides.
    pub solidity: f64,
    /// Ratio of the area to the area of a circle with the same perimeter (sides of pixels, including the edge of the
    /// image), mean over pixels.
    pub compactness: f64,
}

/// Shapes of all regions, connected or not.
pub fn shapes(image: &LabelImage<'_>) -> Shapes {
    let areas = image.areas();
    let outlines = outlines(image, areas.len());
    let mut perimeters = vec![0_u64; areas.len()];
    for (at, label) in image.labels.iter().enumerate() {
        perimeters[*label as usize] += u64::from(image.open_sides(at).iter().sum::<u32>());
    }
    let mut extent = 0.0;
    let mut solidity = 0.0;
    let mut compactness = 0.0;
    let mut n = 0.0;
    for ((area, outline), perimeter) in areas.iter().zip(&outlines).zip(perimeters).filter(|((area, _), _)| **area > 0)
    {
        let area = *area as f64;
        n += 1.0;
        extent += area / outline.box_area() as f64;
        solidity += area / outline.hull_area() as f64;
        compactness += area * 4.0 * PI * area / (perimeter as f64).powi(2);
    }
    Shapes { extent: extent / n, solidity: solidity / n, compactness: compactness / image.labels.len() as f64 }
}

/// The outermost pixels of a region: for each row from the first to the last, the first and the last column. `None` in
/// a row without pixels.
#[derive(Default)]
struct Outline {
    first_row: usize,
    columns: Vec<Option<[usize; 2]>>,
}

fn outlines(image: &LabelImage<'_>, n_labels: usize) -> Vec<Outline> {
    let mut outlines: Vec<Outline> = (0..n_labels).map(|_| Outline::default()).collect();
    for (row, labels) in image.labels.chunks_exact(image.columns).enumerate() {
        for (column, label) in labels.iter().enumerate() {
            let outline = &mut outlines[*label as usize];
            if outline.columns.is_empty() {
                outline.first_row = row;
            }
            outline.columns.resize(row - outline.first_row + 1, None);
            if let Some(ends) = outline.columns.last_mut() {
                ends.get_or_insert([column, column])[1] = column;
            }
        }
    }
    outlines
}

impl Outline {
    fn box_area(&self) -> usize {
        let ends = || self.columns.iter().flatten();
        let first = ends().map(|[first, _]| *first).min().unwrap_or(0);
        let last = ends().map(|[_, last]| *last).max().unwrap_or(0);
        (last - first + 1) * self.columns.len()
    }

    /// Number of pixels whose center is in the convex hull of the midpoints of all pixels' sides, or on its boundary.
    /// Computed in integers: coordinates are twice the coordinates of the pixels.
    fn hull_area(&self) -> i64 {
        let middles = |(row, ends): (usize, &Option<[usize; 2]>)| {
            let y = 2 * (self.first_row + row) as i64;
            ends.map(|[first, last]| {
                let [first, last] = [first, last].map(|column| 2 * column as i64);
                [[first - 1, y], [last + 1, y], [first, y - 1], [first, y + 1], [last, y - 1], [last, y + 1]]
            })
        };
        let points: Vec<[i64; 2]> = self.columns.iter().enumerate().filter_map(middles).flatten().collect();
        let sides = [1, -1].map(|direction| {
            let mut chain: Vec<[i64; 2]> = points.clone();
            // Along y: the left (or right) boundary of the hull.
            chain.sort_unstable_by_key(|[x, y]| (*y, direction * x));
            chain.dedup_by_key(|point| point[1]);
            rim(&chain, direction)
        });
        let rows = self.columns.len() as i64;
        let inside = |row: i64| {
            let y = 2 * (self.first_row as i64 + row);
            // x = numerator / denominator on each boundary, rounded inwards to a pixel.
            let [left, right] = [0, 1].map(|k| crossing(&sides[k], y));
            let first = -(-left.0).div_euclid(2 * left.1);
            let last = right.0.div_euclid(2 * right.1);
            (last - first + 1).max(0)
        };
        (0..rows).map(inside).sum()
    }
}

/// The convex boundary of points in ascending y. Direction 1: the left one, -1: the right one.
fn rim(points: &[[i64; 2]], direction: i64) -> Vec<[i64; 2]> {
    let mut rim: Vec<[i64; 2]> = Vec::new();
    for point in points {
        while let [.., a, b] = rim.as_slice() {
            let turn = (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0]);
            if direction * turn >= 0 {
                rim.pop();
            } else {
                break;
            }
        }
        rim.push(*point);
    }
    rim
}

/// Intersection of a boundary with a row: numerator and positive denominator of x.
fn crossing(rim: &[[i64; 2]], y: i64) -> (i64, i64) {
    let above = rim.partition_point(|point| point[1] <= y).clamp(1, rim.len() - 1);
    let [x0, y0] = rim[above - 1];
    let [x1, y1] = rim[above];
    (x0 * (y1 - y0) + (x1 - x0) * (y - y0), y1 - y0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shapes_of(rows: &[&str]) -> Shapes {
        let labels: Vec<u32> = rows.concat().bytes().map(|byte| u32::from(byte == b'#')).collect();
        let image = LabelImage::new(rows[0].len(), &labels).expect("an image");
        // Shape of the marked region only: the background has its own shape.
        let outline = &outlines(&image, 2)[1];
        let area = image.areas()[1] as f64;
        Shapes {
            extent: area / outline.box_area() as f64,
            solidity: area / outline.hull_area() as f64,
            ..shapes(&image)
        }
    }

    #[test]
    fn solid_shapes_fill_their_hulls() {
        for rows in [&["....", ".##.", ".##."][..], &["#"], &["..#..", ".###.", "#####"], &["####"]] {
            assert_eq!(shapes_of(rows).solidity, 1.0, "{rows:?}");
        }
        assert_eq!(shapes_of(&["..#..", ".###.", "#####"]).extent, 9.0 / 15.0);
    }

    #[test]
    fn distant_parts_are_one_region_with_its_hull() {
        let found = shapes_of(&["#...", "....", "...#"]);
        assert_eq!(found.extent, 2.0 / 12.0);
        // The hull also contains the pixels next to the diagonal.
        assert_eq!(found.solidity, 2.0 / 4.0);
    }

    #[test]
    fn compactness_of_a_square_is_a_quarter_of_pi() {
        let labels = [7; 16];
        let found = shapes(&LabelImage::new(4, &labels).expect("an image"));
        assert!((found.compactness - PI / 4.0).abs() < 1e-12);
    }
}
