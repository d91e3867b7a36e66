//! Scores of hand-made labels, with the expected values computed by hand.

use scores::{Overlaps, PointLabel};

const VOID: u8 = 0;
const ROAD: u8 = 7;
const CAR: u8 = 10;

fn label(class: u8, instance: u32) -> PointLabel {
    PointLabel { class, instance }
}

fn overlaps(rows: &[(PointLabel, PointLabel, u64)]) -> Overlaps {
    let mut overlaps = Overlaps::default();
    for &(truth, predicted, n) in rows {
        (0..n).for_each(|_| overlaps.add(truth, predicted));
    }
    overlaps
}

#[test]
fn perfect_prediction_scores_1() {
    let rows =
        [(label(CAR, 1), label(CAR, 8), 30), (label(CAR, 2), label(CAR, 9), 5), (label(ROAD, 0), label(ROAD, 0), 9)];
    let score = overlaps(&rows).score(CAR, VOID, 1);
    assert_eq!([score.sm(), score.pq(), score.sq(), score.rq(), score.miou()], [1.0; 5]);
    assert_eq!((score.n_true, score.n_predicted), (2, 2));
}

#[test]
fn misses_false_positives_and_wrong_borders_lower_their_scores() {
    let rows = [
        // IoU 60 / (80 + 70 - 60).
        (label(CAR, 1), label(CAR, 1), 60),
        (label(CAR, 1), label(ROAD, 0), 20),
        (label(ROAD, 0), label(CAR, 1), 10),
        // IoU 10 / 20 is not above one half: a miss and a false positive.
        (label(CAR, 2), label(CAR, 2), 10),
        (label(CAR, 2), label(CAR, 0), 10),
        // A miss and a false positive.
        (label(CAR, 3), label(ROAD, 0), 7),
        (label(ROAD, 0), label(CAR, 4), 7),
    ];
    let score = overlaps(&rows).score(CAR, VOID, 1);
    let iou = 60.0 / 90.0;
    assert_eq!((score.n_true, score.n_predicted, score.matches.clone()), (3, 3, vec![iou]));
    assert_eq!(score.sm(), 1.0 / 3.0);
    assert_eq!(score.sq(), iou);
    assert_eq!(score.rq(), 1.0 / (1.0 + 0.5 * 2.0 + 0.5 * 2.0));
    assert_eq!(score.pq(), score.sq() * score.rq());
    assert_eq!(score.miou(), iou / 3.0);
}

#[test]
fn void_and_crowd_points_are_ignored() {
    let rows = [
        // Half of the prediction is on void: IoU is 20 / (20 + 40 - 20 - 20).
        (label(CAR, 1), label(CAR, 1), 20),
        (label(VOID, 0), label(CAR, 1), 20),
        // The first prediction has more than half of its points on a crowd: no false positive. The second has exactly half.
        (label(CAR, 0), label(CAR, 2), 6),
        (label(ROAD, 0), label(CAR, 2), 5),
        (label(CAR, 0), label(CAR, 3), 5),
        (label(ROAD, 0), label(CAR, 3), 5),
    ];
    let score = overlaps(&rows).score(CAR, VOID, 1);
    assert_eq!((score.n_true, score.n_predicted, score.matches), (1, 2, vec![1.0]));
}

#[test]
fn instance_of_wrong_class_is_a_miss_and_a_false_positive() {
    let mut overlaps = overlaps(&[(label(CAR, 1), label(4, 1), 10)]);
    let car = overlaps.score(CAR, VOID, 1);
    let person = overlaps.score(4, VOID, 1);
    assert_eq!((car.n_true, car.n_predicted, car.pq()), (1, 0, 0.0));
    assert_eq!((person.n_true, person.n_predicted, person.pq()), (0, 1, 0.0));
    assert!(person.sm().is_nan() && car.sq().is_nan());
}

#[test]
fn score_does_not_depend_on_order_of_points() {
    let mut overlaps = Overlaps::default();
    for i in 0..100_u32 {
        overlaps.add(label(CAR, 1 + i % 3), label(CAR, 1 + i % 3));
    }
    let score = overlaps.score(CAR, VOID, 1);
    assert_eq!(score.matches, [1.0; 3]);
    overlaps.add(label(CAR, 1), label(ROAD, 0));
    assert_eq!(overlaps.score(CAR, VOID, 1).matches, [34.0 / 35.0, 1.0, 1.0]);
}

#[test]
fn true_instances_below_min_points_are_ignored() {
    let rows = [
        (label(CAR, 1), label(CAR, 1), 20),
        (label(CAR, 2), label(CAR, 2), 4),
        (label(CAR, 3), label(ROAD, 0), 4),
        // 4 of its 9 points are on an instance that is too small: not more than half, so a false positive.
        (label(CAR, 4), label(CAR, 3), 4),
        (label(ROAD, 0), label(CAR, 3), 5),
    ];
    let score = overlaps(&rows).score(CAR, VOID, 5);
    assert_eq!((score.n_true, score.n_predicted, score.matches), (1, 2, vec![1.0]));
}
