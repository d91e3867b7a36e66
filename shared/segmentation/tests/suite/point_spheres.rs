//! Spheres and squares of clouds: coverage, and averaged votes.

use candle_core::{Device, Tensor};
use neighbors::{SpatialIndex, squared_distance};
use random::Random;
use segmentation::points::{
    CloudPrediction, Parameters, Pass, PointBatch, PointNetworkSpec, Region, RegionInput, Regions, SphereSettings,
    SquareSettings, Votes, sphere,
};

/// A road of 60 x 8 m with facades of 12 m on both sides.
fn street(n: usize) -> Vec<[f32; 3]> {
    let mut random = Random::new(1);
    let point = |i: usize| {
        let along = random.range(0.0, 60.0);
        let across = random.range(-4.0, 4.0);
        let up = random.range(0.0, 12.0);
        [[along, across, 0.0], [along, -4.0, up], [along, 4.0, up]][i % 3]
    };
    (0..n).map(point).collect()
}

#[test]
fn spheres_of_the_grid_cover_every_point() {
    let mut points = street(20_000);
    points.push([f32::NAN; 3]);
    let settings = SphereSettings { radius_m: 3.0, overlap_m: 1.0 };
    let centers = settings.centers(&points).expect("valid");
    let inside = |point: [f32; 3]| centers.iter().filter(|c| squared_distance(point, **c) <= 9.0).count();
    assert!(points[..20_000].iter().all(|point| inside(*point) > 0));
    // The first centers are grid centers, 5 m apart.
    let on_grid = |center: &&[f32; 3]| center.iter().all(|v| (v / 5.0 - 0.5).fract().abs() < 1e-4);
    let n_grid = centers.iter().take_while(on_grid).count();
    assert!((60..centers.len()).contains(&n_grid), "{n_grid} of {}", centers.len());
    assert_eq!(centers, settings.centers(&points).expect("valid"));
    assert!(settings.centers(&[]).expect("valid").is_empty());
}

#[test]
fn spheres_without_size_are_rejected() {
    for (radius_m, overlap_m) in [(0.0, 0.0), (f32::NAN, 1.0), (10.0, 20.0), (10.0, -1.0), (10.0, f32::NAN)] {
        assert!(SphereSettings { radius_m, overlap_m }.centers(&[[0.0; 3]]).is_err(), "{radius_m} {overlap_m}");
    }
}

#[test]
fn squares_cover_every_point_and_share_their_margins() {
    let mut points = street(20_000);
    points.push([f32::NAN; 3]);
    let settings = SquareSettings { side_m: 6.0, margin_m: 0.5 };
    let squares = settings.squares(&points).expect("valid");
    let mut n_squares_of = vec![0; points.len()];
    for Region { center, points: members } in &squares {
        // Centers are the centers of squares of 5 m.
        assert!(center[..2].iter().all(|v| (v / 5.0 - 0.5).fract().abs() < 1e-6), "{center:?}");
        let reach =
            |point: &u32| (0..2).map(|axis| (points[*point as usize][axis] - center[axis]).abs()).fold(0.0, f32::max);
        assert!(members.is_sorted() && members.iter().all(|point| reach(point) <= 3.0));
        let n_within = points.iter().filter(|p| (0..2).all(|axis| (p[axis] - center[axis]).abs() < 3.0)).count();
        assert_eq!(members.len(), n_within);
        let n_below = members.iter().filter(|point| points[**point as usize][2] < center[2]).count();
        assert!(n_below <= members.len() / 4, "{n_below} of {}", members.len());
        for point in members {
            n_squares_of[*point as usize] += 1;
        }
    }
    assert!(n_squares_of[..20_000].iter().all(|n| (1..=4).contains(n)) && n_squares_of[20_000] == 0);
    assert!(n_squares_of.contains(&4));
    for (side_m, margin_m) in [(0.0, 0.0), (f32::NAN, 0.0), (10.0, 4.5), (10.0, -1.0), (10.0, f32::NAN)] {
        assert!(SquareSettings { side_m, margin_m }.squares(&points).is_err(), "{side_m} {margin_m}");
    }
    assert!(settings.squares(&[]).expect("valid").is_empty());
}

#[test]
fn sphere_contains_the_points_within_its_radius() {
    let points = street(3000);
    let members = sphere(&SpatialIndex::new(&points), [30.0, 0.0, 1.0], 10.0);
    let expected = (0..3000).filter(|i| squared_distance(points[*i], [30.0, 0.0, 1.0]) <= 100.0);
    let mut sorted = members.clone();
    sorted.sort_unstable();
    assert_eq!(sorted, expected.map(|i| i as u32).collect::<Vec<_>>());
}

#[test]
fn votes_of_two_spheres_are_averaged() {
    let mut votes = Votes::new(3, 2);
    votes.add(&[0, 2], &[0.0, 0.0, 3.0_f32.ln(), 0.0]);
    votes.add(&[2], &[0.0, 0.0]);
    let means = votes.means();
    let expected = [0.5, 0.5, 0.0, 0.0, 0.625, 0.375];
    assert_eq!(means.len(), expected.len());
    assert!(means.iter().zip(expected).all(|(mean, expected)| (mean - expected).abs() < 1e-6), "{means:?}");
}

#[test]
fn prediction_is_the_mean_of_the_spheres_that_contain_a_point() {
    let text = r#"{"kind": "kpconv", "inputs": 4, "outputs": 3, "width": 8, "levels": 3, "blocks": 1, "kernel_points": 15,
        "cell_m": 0.8, "neighbors": 12}"#;
    let spec: PointNetworkSpec = serde_json::from_str(text).expect("a network");
    let parameters = Parameters::random(&spec.parameters(), &mut Random::new(3)).expect("a start");
    let points = street(1500);
    let features: Vec<f32> = points.iter().flat_map(|p| [p[0].sin(), p[1].cos(), 0.5, p[2]]).collect();
    let settings = SphereSettings { radius_m: 10.0, overlap_m: 10.0 / 3.0 };
    let regions = Regions::Spheres(settings);
    let prediction = CloudPrediction { network: &spec, parameters: &parameters, regions, temperature: 1.0, seed: 0 };
    let input = |region: &Region| {
        let position = |p: &u32| std::array::from_fn(|axis| points[*p as usize][axis] - region.center[axis]);
        let values = region.points.iter().flat_map(|p| features[4 * *p as usize..][..4].to_vec());
        RegionInput { positions: region.points.iter().map(position).collect(), features: values.collect() }
    };
    let means = prediction.per_point(&points, input).expect("runs");
    assert_eq!(means.len(), 4500);
    assert!(means.chunks(3).all(|means| (means.iter().sum::<f32>() - 1.0).abs() < 1e-5));

    // Manual computation for one point.
    let index = SpatialIndex::new(&points);
    let mut sum = [0.0; 3];
    let mut n = 0;
    for center in settings.centers(&points).expect("valid") {
        let members = sphere(&index, center, 10.0);
        let Some(place) = members.iter().position(|point| *point == 77) else { continue };
        let positions = members.iter().map(|p| std::array::from_fn(|axis| points[*p as usize][axis] - center[axis]));
        let values: Vec<f32> = members.iter().flat_map(|p| features[4 * *p as usize..][..4].to_vec()).collect();
        let plan =
            spec.plan(PointBatch::new(positions.collect(), vec![members.len()]).expect("valid"), 0).expect("valid");
        let values = Tensor::from_vec(values, (members.len(), 4), &Device::Cpu).expect("rows");
        let scores = spec.run(&mut Pass::evaluation(&parameters), &plan, &values).expect("runs");
        let scores = scores.get(place).and_then(|row| row.to_vec1::<f32>()).expect("a row");
        let total: f32 = scores.iter().map(|score| score.exp()).sum();
        (0..3).for_each(|class| sum[class] += scores[class].exp() / total);
        n += 1;
    }
    assert!(n > 1, "point 77 is in one sphere");
    for class in 0..3 {
        assert!((means[3 * 77 + class] - sum[class] / n as f32).abs() < 1e-5);
    }
    let short = |region: &Region| RegionInput { features: vec![0.0], ..input(region) };
    assert!(prediction.per_point(&points, short).is_err());
    let flat = CloudPrediction { temperature: 1e6, ..prediction }.per_point(&points, input).expect("runs");
    assert_eq!(flat.len(), means.len());
    assert!(flat.iter().all(|probability| (probability - 1.0 / 3.0).abs() < 1e-3), "a large temperature");
}
