//! Back-projection from classes of pixels to classes of points (thesis figure 6.7).

use geometry::{NO_POINT, RangeImage};

/// Class of a point without a class.
pub const NO_CLASS: u8 = u8::MAX;

/// Rule for the class of a point that is not the nearest of its pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BackProjection {
    /// The class of its pixel.
    Index,
    /// No class.
    Closest,
    /// The most frequent class of the k neighbors with the most similar range in a window around its pixel (`RangeNet++`, Milioto et
    /// al. 2019): window 5 x 5, distance |range difference| (1 - gauss), sigma 1 pixel, at most 1 m.
    Nearest {
        /// Number of neighbors: 1, 3, 5, 7.
        k: usize,
    },
}

/// Half width of the window, pixels.
const REACH: usize = 2;
/// Largest range difference of a voting neighbor, m.
const CUTOFF_M: f32 = 1.0;

/// The class of every point from the classes of the pixels. The nearest point of a pixel gets the class of the pixel
/// with every method; points outside the image get no class.
pub fn back_project(image: &RangeImage, classes: &[u8], method: BackProjection) -> Vec<u8> {
    let of_point = |point: usize| {
        let pixel = image.pixel_of_point[point];
        if pixel == NO_POINT {
            return NO_CLASS;
        }
        let own = classes[pixel as usize];
        match method {
            _ if image.is_shown(point) => own,
            BackProjection::Index => own,
            BackProjection::Closest => NO_CLASS,
            BackProjection::Nearest { k } => nearest(image, classes, point, k).unwrap_or(own),
        }
    };
    (0..image.pixel_of_point.len()).map(of_point).collect()
}

/// The pixel whose class a point gets: the pixel of the neighbor with the most similar range in the window, or the
/// point's own pixel if no neighbor is near; `None` outside the image.
pub fn pixel_for(image: &RangeImage, point: usize) -> Option<u32> {
    let own = image.pixel_of_point[point];
    if own == NO_POINT || image.is_shown(point) {
        return (own != NO_POINT).then_some(own);
    }
    let best = neighbors(image, point).min_by(|a, b| a.distance_m.total_cmp(&b.distance_m));
    Some(best.map_or(own, |near| image.pixel_of_point[near.point]))
}

/// A point in the window.
#[derive(Clone, Copy)]
struct Near {
    /// Difference of the ranges, smaller for nearer pixels.
    distance_m: f32,
    point: usize,
}

/// Neighbors in the window, without neighbors beyond the cutoff.
fn neighbors(image: &RangeImage, point: usize) -> impl Iterator<Item = Near> {
    let range_m = image.range_m[point];
    image.window(point, REACH).filter_map(move |(neighbor, [dy, dx])| {
        let difference = (image.range_m[neighbor] - range_m).abs();
        let far = 1.0 - (-0.5 * (dy * dy + dx * dx) as f32).exp();
        // The nearest point of the own pixel counts as one pixel away.
        let far = if dy == 0 && dx == 0 { 1.0 - (-0.5_f32).exp() } else { far };
        (difference <= CUTOFF_M).then_some(Near { distance_m: difference * far, point: neighbor })
    })
}

fn nearest(image: &RangeImage, classes: &[u8], point: usize, k: usize) -> Option<u8> {
    let mut near: Vec<Near> = neighbors(image, point).collect();
    near.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m).then(a.point.cmp(&b.point)));
    near.truncate(k);
    let class_of = |near: &Near| classes[image.pixel_of_point[near.point] as usize];
    let votes = |class: u8| near.iter().filter(|near| class_of(near) == class).count();
    // The nearest neighbor wins a tie: `max_by_key` returns the last of equal elements, so the order is reversed.
    near.iter().rev().map(class_of).max_by_key(|&class| votes(class))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pixel (0, 1) shows a pole at 5 m in front of a wall at 9 m, which its neighbors show.
    fn pole_before_wall() -> (RangeImage, Vec<u8>) {
        let wall = |column| (Some((0, column)), 9.0);
        let points = [wall(0), (Some((0, 1)), 5.0), wall(2), wall(3), (Some((0, 1)), 9.1), (None, 1.0)];
        (RangeImage::new(1, 8, points), vec![7, 3, 7, 7, 0, 0, 0, 0])
    }

    #[test]
    fn occluded_point_gets_class_of_its_surface() {
        let (image, classes) = pole_before_wall();
        let classes_of = |method| back_project(&image, &classes, method);
        assert_eq!(classes_of(BackProjection::Index), [7, 3, 7, 7, 3, NO_CLASS]);
        assert_eq!(classes_of(BackProjection::Closest), [7, 3, 7, 7, NO_CLASS, NO_CLASS]);
        for k in [1, 3, 5, 7] {
            assert_eq!(classes_of(BackProjection::Nearest { k }), [7, 3, 7, 7, 7, NO_CLASS]);
        }
        assert_eq!(pixel_for(&image, 1), Some(1));
        assert_ne!(pixel_for(&image, 4), Some(1));
        assert_eq!(pixel_for(&image, 5), None);
    }

    #[test]
    fn point_without_near_neighbor_gets_class_of_its_pixel() {
        let image = RangeImage::new(1, 8, [(Some((0, 1)), 5.0), (Some((0, 1)), 9.0)]);
        let classes = [1, 2, 3, 4, 5, 6, 7, 8];
        assert_eq!(back_project(&image, &classes, BackProjection::Nearest { k: 3 }), [2, 2]);
    }
}
