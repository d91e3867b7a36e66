//! Intersection of a ray with one primitive: range of the first hit, and the normal there.

use crate::flat::Flat;
use crate::ray::{MIN_RANGE_M, Ray, Vec3};
use crate::shape::Shape;
use nalgebra::UnitQuaternion;
use random::{hash, mix, unit};

impl Shape {
    /// Range of the first hit before `max_m`.
    pub fn range(&self, ray: &Ray, max_m: f32) -> Option<f32> {
        let range = match *self {
            Self::Triangle { .. } => Flat::from_shape(self)?.range(ray, max_m)?,
            Self::Panel { corner, edge1, edge2, fill } => {
                let range = Flat { corner, edge1, edge2, reach: 2.0 }.range(ray, max_m)?;
                (fill >= 1.0 || unit(porous_hash(ray, &corner)) < fill).then_some(range)?
            }
            Self::Cuboid { center, half, rotation } => cuboid_range(ray, &center, &half, &rotation)?,
            Self::Cone { base, axis, length, radii } => cone_range(ray, &base, &axis, length, radii)?,
            Self::Cylinder { base, axis, length, radius } => cylinder_range(ray, &base, &axis, length, radius)?,
            Self::Sphere { center, radius } => {
                let [enter, leave] = sphere_ranges(ray, &center, radius)?;
                if enter > MIN_RANGE_M { enter } else { leave }
            }
            Self::Porous { center, radius, free_path } => {
                let [enter, leave] = sphere_ranges(ray, &center, radius)?;
                let depth = -(1.0 - unit(porous_hash(ray, &center))).ln() * free_path;
                let range = enter.max(0.0) + depth;
                (range < leave).then_some(range)?
            }
        };
        (range > MIN_RANGE_M && range < max_m).then_some(range)
    }
    /// Unit normal at a hit, against the ray.
    pub fn normal(&self, ray: &Ray, range: f32) -> Vec3 {
        let point = ray.at(range);
        let outward = match *self {
            Self::Triangle { edge1, edge2, .. } | Self::Panel { edge1, edge2, .. } => edge1.cross(&edge2),
            Self::Cuboid { center, half, rotation } => {
                // The face whose plane is nearest, measured in half edges.
                let inside = rotation.inverse_transform_vector(&(point - center)).component_div(&half);
                rotation * Vec3::ith(inside.iamax(), 1.0)
            }
            Self::Cone { base, axis, length, radii } => {
                let along = (point - base).dot(&axis);
                let radial = point - base - axis * along;
                let slope = (radii[1] - radii[0]) / length;
                let on_end = radial.norm() < 0.999 * (radii[0] + slope * along)
                    && (along < 0.01 * length || along > 0.99 * length);
                if on_end { axis } else { radial - axis * (slope * radial.norm()) }
            }
            Self::Cylinder { base, axis, length, radius } => {
                let along = (point - base).dot(&axis);
                let radial = point - base - axis * along;
                // On an end the hit lies inside the tube.
                let on_end = radial.norm() < 0.999 * radius && (along < 0.01 * length || along > 0.99 * length);
                if on_end { axis } else { radial }
            }
            Self::Sphere { center, .. } => point - center,
            Self::Porous { center, radius, .. } => {
                let h = mix(porous_hash(ray, &center));
                let part = |shift: u32| ((h >> shift) & 0xffff) as f32 / 32768.0 - 1.0;
                // Leaves have random directions; outer leaves tend to point outward, which gives a crown light and
                // shade.
                (point - center) / radius + Vec3::new(part(0), part(16), part(32)) * 0.6
            }
        };
        let outward = outward.try_normalize(1e-12).unwrap_or(-ray.direction);
        if outward.dot(&ray.direction) > 0.0 { -outward } else { outward }
    }
}

fn porous_hash(ray: &Ray, center: &Vec3) -> u64 {
    hash(ray.seed, u64::from(center.x.to_bits()) << 32 | u64::from(center.z.to_bits()))
}

/// Slabs in the box's own frame (Kay and Kajiya, "Ray tracing complex scenes", 1986).
fn cuboid_range(ray: &Ray, center: &Vec3, half: &Vec3, rotation: &UnitQuaternion<f32>) -> Option<f32> {
    let origin = rotation.inverse_transform_vector(&(ray.origin - center));
    let inverse = rotation.inverse_transform_vector(&ray.direction).map(|d| 1.0 / d);
    let to_low = (-half - origin).component_mul(&inverse);
    let to_high = (half - origin).component_mul(&inverse);
    let enter = to_low.x.min(to_high.x).max(to_low.y.min(to_high.y)).max(to_low.z.min(to_high.z));
    let leave = to_low.x.max(to_high.x).min(to_low.y.max(to_high.y)).min(to_low.z.max(to_high.z));
    (enter <= leave).then_some(if enter > MIN_RANGE_M { enter } else { leave })
}

/// Range at which the ray meets the side of a cone, `|off(t)| = radius(along(t))`, or one of its ends.
fn cone_range(ray: &Ray, base: &Vec3, axis: &Vec3, length: f32, radii: [f32; 2]) -> Option<f32> {
    // Start at the point of the ray nearest to the base: the small differences below then stay precise at long range.
    let shift = (base - ray.origin).dot(&ray.direction);
    let from_base = ray.at(shift) - base;
    let slope = (radii[1] - radii[0]) / length;
    let direction_along = ray.direction.dot(axis);
    let start_along = from_base.dot(axis);
    let direction_off = ray.direction - axis * direction_along;
    let start_off = from_base - axis * start_along;
    let start_radius = radii[0] + slope * start_along;
    let a = direction_off.norm_squared() - (slope * direction_along).powi(2);
    let half_b = direction_off.dot(&start_off) - slope * direction_along * start_radius;
    let c = start_off.norm_squared() - start_radius * start_radius;
    let mut best = f32::INFINITY;
    let mut consider = |step: f32, on_side: bool| {
        let along = start_along + direction_along * step;
        if shift + step > MIN_RANGE_M && (!on_side || (0.0..=length).contains(&along)) {
            best = best.min(shift + step);
        }
    };
    if a.abs() > 1e-9 {
        let root2 = half_b * half_b - a * c;
        if root2 >= 0.0 {
            let root = root2.sqrt();
            consider((-half_b - root) / a, true);
            consider((-half_b + root) / a, true);
        }
    } else if half_b.abs() > 1e-9 {
        consider(-0.5 * c / half_b, true);
    }
    if direction_along.abs() > 1e-6 {
        for (end, radius) in [(0.0, radii[0]), (length, radii[1])] {
            let step = (end - start_along) / direction_along;
            if (start_off + direction_off * step).norm_squared() <= radius * radius {
                consider(step, false);
            }
        }
    }
    (best < f32::INFINITY).then_some(best)
}

/// Ranges at which the line enters and leaves the sphere; `None` if it misses or the sphere lies behind.
fn sphere_ranges(ray: &Ray, center: &Vec3, radius: f32) -> Option<[f32; 2]> {
    let to_center = center - ray.origin;
    let along = to_center.dot(&ray.direction);
    // The distance of the line from the center is measured along the perpendicular, which stays precise at long range.
    let off2 = (to_center - ray.direction * along).norm_squared();
    let half2 = radius * radius - off2;
    if half2 <= 0.0 {
        return None;
    }
    let half = half2.sqrt();
    (along + half > MIN_RANGE_M).then_some([along - half, along + half])
}

fn cylinder_range(ray: &Ray, base: &Vec3, axis: &Vec3, length: f32, radius: f32) -> Option<f32> {
    let from_base = ray.origin - base;
    let direction_along = ray.direction.dot(axis);
    let start_along = from_base.dot(axis);
    let direction_off = ray.direction - axis * direction_along;
    let start_off = from_base - axis * start_along;
    let a = direction_off.norm_squared();
    let mut best = f32::INFINITY;
    if a > 1e-12 {
        let nearest = -direction_off.dot(&start_off) / a;
        let half2 = (radius * radius - (start_off + direction_off * nearest).norm_squared()) / a;
        if half2 <= 0.0 {
            return None;
        }
        let half = half2.sqrt();
        for range in [nearest - half, nearest + half] {
            let along = start_along + direction_along * range;
            if range > MIN_RANGE_M && (0.0..=length).contains(&along) {
                best = best.min(range);
            }
        }
    }
    if direction_along.abs() > 1e-6 {
        for end in [0.0, length] {
            let range = (end - start_along) / direction_along;
            let inside = (start_off + direction_off * range).norm_squared() <= radius * radius;
            if range > MIN_RANGE_M && inside {
                best = best.min(range);
            }
        }
    }
    (best < f32::INFINITY).then_some(best)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Isometry3;

    fn ray(origin: [f32; 3], direction: [f32; 3]) -> Ray {
        Ray { origin: origin.into(), direction: Vec3::from(direction).normalize(), seed: 1 }
    }

    #[test]
    fn triangle_is_hit_inside_and_missed_outside() {
        let shape = Shape::triangle(Vec3::new(5.0, 0.0, 0.0), Vec3::new(5.0, 2.0, 0.0), Vec3::new(5.0, 0.0, 2.0));
        let inside = ray([0.0, 0.5, 0.5], [1.0, 0.0, 0.0]);
        assert_eq!(shape.range(&inside, 100.0), Some(5.0));
        assert_eq!(shape.range(&inside, 4.9), None);
        assert_eq!(shape.normal(&inside, 5.0), Vec3::new(-1.0, 0.0, 0.0));
        assert_eq!(shape.range(&ray([0.0, 1.1, 1.1], [1.0, 0.0, 0.0]), 100.0), None);
        assert_eq!(shape.range(&ray([10.0, 0.5, 0.5], [1.0, 0.0, 0.0]), 100.0), None);
        let slanted = ray([0.0, 0.5, -4.5], [1.0, 0.0, 1.0]);
        let range = shape.range(&slanted, 100.0).expect("hit");
        assert!((range - 5.0 * 2.0_f32.sqrt()).abs() < 1e-5);
    }

    #[test]
    fn sphere_range_equals_closed_form() {
        let shape = Shape::Sphere { center: Vec3::new(0.0, 80.0, 0.0), radius: 2.0 };
        let off = 1.2_f32;
        let hit = ray([off, 0.0, 0.0], [0.0, 1.0, 0.0]);
        let range = shape.range(&hit, 100.0).expect("hit");
        assert!((range - (80.0 - (4.0 - off * off).sqrt())).abs() < 1e-4);
        assert!((shape.normal(&hit, range) - Vec3::new(0.6, -0.8, 0.0)).norm() < 1e-4);
        assert_eq!(shape.range(&ray([2.1, 0.0, 0.0], [0.0, 1.0, 0.0]), 100.0), None);
        let from_inside = shape.range(&ray([0.0, 80.0, 0.0], [0.0, 0.0, 1.0]), 100.0).expect("hit");
        assert!((from_inside - 2.0).abs() < 1e-4);
    }

    #[test]
    fn cylinder_is_hit_on_side_and_ends() {
        let shape = Shape::cylinder(Vec3::new(10.0, 0.0, 0.0), Vec3::new(10.0, 0.0, 3.0), 0.5);
        let side = ray([0.0, 0.3, 1.0], [1.0, 0.0, 0.0]);
        let range = shape.range(&side, 100.0).expect("side");
        assert!((range - 9.6).abs() < 1e-4);
        assert!((shape.normal(&side, range) - Vec3::new(-0.8, 0.6, 0.0)).norm() < 1e-3);
        let top = ray([10.2, 0.0, 8.0], [0.0, 0.0, -1.0]);
        let range = shape.range(&top, 100.0).expect("top");
        assert!((range - 5.0).abs() < 1e-5);
        assert_eq!(shape.normal(&top, range), Vec3::new(0.0, 0.0, 1.0));
        assert_eq!(shape.range(&ray([0.0, 0.0, 3.1], [1.0, 0.0, 0.0]), 100.0), None);
        assert_eq!(shape.range(&ray([0.0, 0.6, 1.0], [1.0, 0.0, 0.0]), 100.0), None);
    }

    #[test]
    fn rotated_cuboid_is_hit_on_its_face() {
        let rotation = UnitQuaternion::from_axis_angle(&Vec3::z_axis(), std::f32::consts::FRAC_PI_4);
        let shape = Shape::Cuboid { center: Vec3::new(10.0, 0.0, 0.0), half: Vec3::new(1.0, 1.0, 2.0), rotation };
        // Its edge points at the origin.
        let near_edge = ray([0.0, 0.1, 0.0], [1.0, 0.0, 0.0]);
        let range = shape.range(&near_edge, 100.0).expect("side");
        assert!((range - (10.0 - 2.0_f32.sqrt() + 0.1)).abs() < 1e-4);
        let normal = shape.normal(&near_edge, range);
        assert!((normal - Vec3::new(-1.0, 1.0, 0.0).normalize()).norm() < 1e-4);
        assert_eq!(shape.range(&ray([0.0, 1.5, 0.0], [1.0, 0.0, 0.0]), 100.0), None);
        let from_inside = shape.range(&ray([10.0, 0.0, 0.0], [0.0, 0.0, 1.0]), 100.0).expect("top");
        assert!((from_inside - 2.0).abs() < 1e-5);
    }

    #[test]
    fn cone_is_hit_on_side_and_base() {
        let tip = Shape::cone(Vec3::new(50.0, 0.0, 0.0), Vec3::new(50.0, 0.0, 2.0), [1.0, 0.0]);
        let side = ray([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]);
        let range = tip.range(&side, 100.0).expect("side");
        assert!((range - 49.5).abs() < 1e-4);
        // Half as wide as high: the slope's normal rises by a half.
        let normal = tip.normal(&side, range);
        assert!((normal - Vec3::new(-2.0, 0.0, 1.0).normalize()).norm() < 1e-3, "{normal}");
        assert_eq!(tip.range(&ray([0.0, 0.6, 1.0], [1.0, 0.0, 0.0]), 100.0), None);
        assert_eq!(tip.range(&ray([0.0, 0.0, 2.1], [1.0, 0.0, 0.0]), 100.0), None);
        let from_below = tip.range(&ray([50.3, 0.0, -3.0], [0.0, 0.0, 1.0]), 100.0).expect("foot");
        assert!((from_below - 3.0).abs() < 1e-5);
        let above = ray([50.5, 0.0, 9.0], [0.0, 0.0, -1.0]);
        assert!((tip.range(&above, 100.0).expect("slope") - 8.0).abs() < 1e-4);
        // Without slope it is a cylinder.
        let straight = Shape::cone(Vec3::zeros(), Vec3::new(0.3, -0.2, 2.0), [0.4, 0.4]);
        let tube = Shape::cylinder(Vec3::zeros(), Vec3::new(0.3, -0.2, 2.0), 0.4);
        for i in 0..400 {
            let y = i as f32 * 0.01 - 2.0;
            let across = ray([-5.0, y, 1.0], [1.0, -0.2 * y, 0.1]);
            match (straight.range(&across, 50.0), tube.range(&across, 50.0)) {
                (Some(a), Some(b)) => assert!((a - b).abs() < 1e-3),
                (a, b) => assert!(a.is_none() && b.is_none() || y.abs() > 0.3, "{y}: {a:?} {b:?}"),
            }
        }
    }

    #[test]
    fn panel_with_fill_stops_that_share_of_rays() {
        let corner = Vec3::new(5.0, -1.0, -1.0);
        let edge1 = Vec3::new(0.0, 2.0, 0.0);
        let shape = Shape::Panel { corner, edge1, edge2: Vec3::new(0.0, 0.5, 2.0), fill: 0.3 };
        let stopped = (0..20_000_u64)
            .filter(|&seed| {
                let through = Ray { seed, ..ray([0.0, 0.9, 0.8], [1.0, 0.0, 0.0]) };
                let range = shape.range(&through, 100.0);
                assert!(range.is_none_or(|range| range == 5.0));
                range.is_some()
            })
            .count();
        assert!((stopped as f32 / 20_000.0 - 0.3).abs() < 0.01, "{stopped}");
        assert_eq!(shape.range(&ray([0.0, -0.9, 0.8], [1.0, 0.0, 0.0]), 100.0), None);
    }

    #[test]
    fn porous_sphere_passes_exponential_share_of_rays() {
        let radius = 1.0_f32;
        let free_path = 0.8_f32;
        let shape = Shape::Porous { center: Vec3::new(10.0, 0.0, 0.0), radius, free_path };
        let n = 20_000_u64;
        let mut passed = 0;
        for seed in 0..n {
            let through = Ray { seed, ..ray([0.0, 0.0, 0.0], [1.0, 0.0, 0.0]) };
            match shape.range(&through, 100.0) {
                Some(range) => assert!((9.0..=11.0).contains(&range)),
                None => passed += 1,
            }
        }
        let expected = (-2.0 * radius / free_path).exp();
        assert!((passed as f32 / n as f32 - expected).abs() < 0.01);
    }

    #[test]
    fn bounds_contain_hits_of_moved_shapes() {
        let pose = Isometry3::new(Vec3::new(1.0, -2.0, 3.0), Vec3::new(0.4, -0.9, 0.3));
        let shapes = [
            Shape::triangle(Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 2.0, 0.0), Vec3::new(0.0, 0.0, 3.0)),
            Shape::cylinder(Vec3::new(0.0, 0.0, -1.0), Vec3::new(0.5, 0.5, 1.0), 0.7),
            Shape::Sphere { center: Vec3::new(0.5, 0.5, 0.5), radius: 1.1 },
            Shape::cone(Vec3::new(0.0, 0.0, -1.0), Vec3::new(0.5, 0.5, 1.0), [0.9, 0.2]),
            Shape::Cuboid { center: Vec3::new(0.2, 0.0, 0.3), half: Vec3::new(1.0, 0.4, 0.7), rotation: pose.rotation },
            Shape::Panel { corner: Vec3::zeros(), edge1: Vec3::x() * 2.0, edge2: Vec3::new(0.5, 2.0, 1.0), fill: 1.0 },
        ];
        for shape in shapes {
            let moved = shape.moved(&pose);
            let [low, high] = moved.bounds();
            let mut hits = 0;
            for i in 0..4000_u64 {
                let part = |k| 2.0 * unit(hash(k, i)) - 1.0;
                let origin = Vec3::new(part(1), part(2), part(3)) * 4.0;
                let direction = Vec3::new(part(4), part(5), part(6)).normalize();
                let local = Ray { origin, direction, seed: 0 };
                let world = Ray {
                    origin: (pose * nalgebra::Point3::from(origin)).coords,
                    direction: pose.rotation * direction,
                    seed: 0,
                };
                let a = shape.range(&local, 50.0);
                let b = moved.range(&world, 50.0);
                if let (Some(a), Some(b)) = (a, b) {
                    assert!((a - b).abs() < 1e-3);
                    let p = world.at(b);
                    assert!((0..3).all(|k| p[k] > low[k] - 1e-3 && p[k] < high[k] + 1e-3));
                    hits += 1;
                }
            }
            assert!(hits > 50, "{hits}");
        }
    }
}
