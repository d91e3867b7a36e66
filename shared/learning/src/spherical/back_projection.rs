//! From classes of pixels to classes of points (thesis figure 6.7).

use geometry::{NO_POINT, RangeImage};

/// Class of a point that has none.
pub const NO_CLASS: u8 = u8::MAX;

/// How a point that its pixel does not show gets a class.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BackProjection {
    /// That of its pixel.
    Index,
    /// None.
    Closest,
    /// The most frequent among the k neighbors of nearest range in a window around its pixel (`RangeNet++`, Milioto et al.
    /// 2019): window 5 x 5, distance |range difference| (1 - gauss), sigma 1 pixel, none beyond 1 m.
    Nearest {
        /// 1, 3, 5, 7.
        k: usize,
    },
}

/// Rows and columns to each side of the window.
const REACH: usize = 2;
/// Neighbors farther than this in range do not vote, m.
const CUTOFF_M: f32 = 1.0;

/// Class of every point by the classes of the pixels. Points that are shown have their pixel's class under each method;
/// points outside have none.
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

/// The pixel whose class a point should have: that of the neighbor of nearest range in the window, its own pixel if none is
/// near; `None` outside the image.
pub fn pixel_for(image: &RangeImage, point: usize) -> Option<u32> {
    let own = image.pixel_of_point[point];
    if own == NO_POINT || image.is_shown(point) {
        return (own != NO_POINT).then_some(own);
    }
    let best = neighbors(image, point).min_by(|a, b| a.0.total_cmp(&b.0));
    Some(best.map_or(own, |(_, neighbor)| image.pixel_of_point[neighbor]))
}

/// Distances and points of the window, those beyond the cutoff left out.
fn neighbors(image: &RangeImage, point: usize) -> impl Iterator<Item = (f32, usize)> {
    let range_m = image.range_m[point];
    image.window(point, REACH).filter_map(move |(neighbor, [dy, dx])| {
        let difference = (image.range_m[neighbor] - range_m).abs();
        let far = 1.0 - (-0.5 * (dy * dy + dx * dx) as f32).exp();
        // The own pixel shows another point: it counts as one a pixel away.
        let far = if dy == 0 && dx == 0 { 1.0 - (-0.5_f32).exp() } else { far };
        (difference <= CUTOFF_M).then_some((difference * far, neighbor))
    })
}

fn nearest(image: &RangeImage, classes: &[u8], point: usize, k: usize) -> Option<u8> {
    let mut near: Vec<(f32, usize)> = neighbors(image, point).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    near.truncate(k);
    let class_of = |neighbor: usize| classes[image.pixel_of_point[neighbor] as usize];
    let votes = |class: u8| near.iter().filter(|(_, neighbor)| class_of(*neighbor) == class).count();
    // The nearest wins a tie: max_by_key takes the last of equals, so the order is turned around.
    near.iter().rev().map(|(_, neighbor)| class_of(*neighbor)).max_by_key(|&class| votes(class))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pixel (0, 1) shows a pole at 5 m before a wall at 9 m that its neighbors show.
    fn pole_before_wall() -> (RangeImage, Vec<u8>) {
        let wall = |column| (Some((0, column)), 9.0);
        let points = [wall(0), (Some((0, 1)), 5.0), wall(2), wall(3), (Some((0, 1)), 9.1), (None, 1.0)];
        (RangeImage::new(1, 8, points), vec![7, 3, 7, 7, 0, 0, 0, 0])
    }

    #[test]
    fn a_hidden_point_gets_the_class_of_its_own_surface() {
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
    fn without_a_neighbor_near_the_pixels_own_class_is_left() {
        let image = RangeImage::new(1, 8, [(Some((0, 1)), 5.0), (Some((0, 1)), 9.0)]);
        let classes = [1, 2, 3, 4, 5, 6, 7, 8];
        assert_eq!(back_project(&image, &classes, BackProjection::Nearest { k: 3 }), [2, 2]);
    }
}
