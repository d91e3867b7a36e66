//! Scores of hand-made labellings, worked out beside each.

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
fn the_truth_has_full_marks() {
    let rows =
        [(label(CAR, 1), label(CAR, 8), 30), (label(CAR, 2), label(CAR, 9), 5), (label(ROAD, 0), label(ROAD, 0), 9)];
    let score = overlaps(&rows).score(CAR, VOID, 1);
    assert_eq!([score.sm(), score.pq(), score.sq(), score.rq(), score.miou()], [1.0; 5]);
    assert_eq!((score.n_true, score.n_predicted), (2, 2));
}

#[test]
fn misses_false_ones_and_borders_lower_each_its_own_score() {
    let rows = [
        // IoU 60 / (80 + 70 - 60).
        (label(CAR, 1), label(CAR, 1), 60),
        (label(CAR, 1), label(ROAD, 0), 20),
        (label(ROAD, 0), label(CAR, 1), 10),
        // IoU 10 / 20 is not above one half: a miss and a false one.
        (label(CAR, 2), label(CAR, 2), 10),
        (label(CAR, 2), label(CAR, 0), 10),
        // Not found, and made up.
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
fn void_and_crowds_are_nobodys_fault() {
    let rows = [
        // Half of the prediction is on void: IoU is 20 / (20 + 40 - 20 - 20).
        (label(CAR, 1), label(CAR, 1), 20),
        (label(VOID, 0), label(CAR, 1), 20),
        // More than half on cars without number: no false one. The other has just half.
        (label(CAR, 0), label(CAR, 2), 6),
        (label(ROAD, 0), label(CAR, 2), 5),
        (label(CAR, 0), label(CAR, 3), 5),
        (label(ROAD, 0), label(CAR, 3), 5),
    ];
    let score = overlaps(&rows).score(CAR, VOID, 1);
    assert_eq!((score.n_true, score.n_predicted, score.matches), (1, 2, vec![1.0]));
}

#[test]
fn a_car_that_was_taken_for_a_person_is_missed_and_made_up() {
    let mut overlaps = overlaps(&[(label(CAR, 1), label(4, 1), 10)]);
    let (car, person) = (overlaps.score(CAR, VOID, 1), overlaps.score(4, VOID, 1));
    assert_eq!((car.n_true, car.n_predicted, car.pq()), (1, 0, 0.0));
    assert_eq!((person.n_true, person.n_predicted, person.pq()), (0, 1, 0.0));
    assert!(person.sm().is_nan() && car.sq().is_nan());
}

#[test]
fn order_and_pieces_do_not_matter() {
    let mut pieces = Overlaps::default();
    for i in 0..100_u32 {
        pieces.add(label(CAR, 1 + i % 3), label(CAR, 1 + i % 3));
    }
    let score = pieces.score(CAR, VOID, 1);
    assert_eq!(score.matches, [1.0; 3]);
    pieces.add(label(CAR, 1), label(ROAD, 0));
    assert_eq!(pieces.score(CAR, VOID, 1).matches, [34.0 / 35.0, 1.0, 1.0]);
}

#[test]
fn true_ones_that_are_too_small_count_for_nobody() {
    let rows = [
        (label(CAR, 1), label(CAR, 1), 20),
        (label(CAR, 2), label(CAR, 2), 4),
        (label(CAR, 3), label(ROAD, 0), 4),
        // 4 of its 9 points lie on what is too small, that is not more than half.
        (label(CAR, 4), label(CAR, 3), 4),
        (label(ROAD, 0), label(CAR, 3), 5),
    ];
    let score = overlaps(&rows).score(CAR, VOID, 5);
    assert_eq!((score.n_true, score.n_predicted, score.matches), (1, 2, vec![1.0]));
}
