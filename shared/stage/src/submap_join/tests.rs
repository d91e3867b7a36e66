use super::*;
use messages::{
    ClassHeader, ClassRow, ClassTopic, ColorHeader, ColorRow, ColorTopic, Envelope, SubmapHeader, SubmapPoint,
};

const N_POINTS: usize = 3;

fn envelope(seq: u64, n_rows: usize) -> Envelope {
    Envelope { seq, len: n_rows as u32, ..Envelope::default() }
}

fn submap(seq: u64) -> Received<SubmapTopic> {
    let rows = vec![SubmapPoint::default(); N_POINTS];
    Received::in_own_memory(envelope(seq, N_POINTS), SubmapHeader::default(), rows)
}

fn class(seq: u64, n_rows: usize) -> Received<ClassTopic> {
    let rows = vec![ClassRow { class_id: seq as u8, score: 0 }; n_rows];
    Received::in_own_memory(envelope(seq, n_rows), ClassHeader::default(), rows)
}

fn color(seq: u64) -> Received<ColorTopic> {
    let rows = vec![ColorRow::default(); N_POINTS];
    Received::in_own_memory(envelope(seq, N_POINTS), ColorHeader::default(), rows)
}

fn join(mode: Mode) -> SubmapJoin {
    SubmapJoin::new(mode).column::<ClassTopic>(true).column::<ColorTopic>(true)
}

/// One tick with these messages.
fn take(join: &mut SubmapJoin, submaps: &[u64], classes: &[u64], colors: &[u64]) -> Result<(), StepError> {
    let mut inputs = Inputs::default();
    for seq in submaps {
        inputs.push(SubmapTopic::TOPIC, submap(*seq));
    }
    for seq in classes {
        inputs.push(ClassTopic::TOPIC, class(*seq, N_POINTS));
    }
    for seq in colors {
        inputs.push(ColorTopic::TOPIC, color(*seq));
    }
    join.take(&mut inputs)
}

/// Numbers of the complete submaps, each with the class of its points and the topics that it lost.
fn complete(join: &mut SubmapJoin) -> Vec<(u64, Option<u8>, Vec<&'static str>)> {
    std::iter::from_fn(|| join.next_complete())
        .map(|joined| {
            let classes = joined.rows::<ClassTopic>().expect("one row for each point");
            (joined.submap.seq(), classes.map(|rows| rows[0].class_id), joined.lost)
        })
        .collect()
}

#[test]
fn submap_is_complete_when_last_column_arrives() {
    let mut join = join(Mode::Offline);
    take(&mut join, &[0, 1], &[], &[0]).expect("in order");
    assert_eq!(complete(&mut join), []);
    join.check_bounds().expect("two submaps may wait");
    take(&mut join, &[], &[0, 1], &[]).expect("in order");
    assert_eq!(complete(&mut join), [(0, Some(0), vec![])]);
    take(&mut join, &[], &[], &[1]).expect("in order");
    assert_eq!(complete(&mut join), [(1, Some(1), vec![])]);
    join.check_empty().expect("nothing waits");
}

#[test]
fn column_out_of_order_is_refused_offline() {
    let mut join = join(Mode::Offline);
    let error = take(&mut join, &[0], &[1], &[]).expect_err("class 0 is missing").to_string();
    assert_eq!(error, "class of submap 1 arrived, but submap 0 was due");
}

#[test]
fn too_many_waiting_messages_are_refused_offline() {
    let mut waiting = join(Mode::Offline);
    take(&mut waiting, &[0, 1, 2], &[0], &[]).expect("in order");
    let error = waiting.check_bounds().expect_err("three may not wait").to_string();
    assert_eq!(error, "submap 0 still waits for color, but 3 submaps wait, at most 2 may");
    let error = waiting.check_empty().expect_err("three are left").to_string();
    assert_eq!(error, "submap 0 still waits for color, but the stream has ended");
    let mut early = join(Mode::Offline);
    take(&mut early, &[], &[0, 1, 2], &[]).expect("in order");
    let error = early.check_bounds().expect_err("three may not wait").to_string();
    assert_eq!(error, "class of submap 0 still waits for its submap, but 3 messages wait, at most 2 may");
}

#[test]
fn column_with_wrong_number_of_rows_is_refused() {
    let mut join = SubmapJoin::new(Mode::Offline).column::<ClassTopic>(true);
    let mut inputs = Inputs::default();
    inputs.push(SubmapTopic::TOPIC, submap(0));
    inputs.push(ClassTopic::TOPIC, class(0, N_POINTS - 1));
    join.take(&mut inputs).expect("in order");
    let joined = join.next_complete().expect("complete");
    let error = joined.rows::<ClassTopic>().expect_err("a row is missing").to_string();
    assert_eq!(error, "class column of submap 0 has 2 rows for 3 points");
}

#[test]
fn columns_of_one_type_are_distinguished_by_their_port() {
    let join = SubmapJoin::new(Mode::Offline).column::<ClassTopic>(true);
    let mut join = join.column_named::<ClassTopic>("class_b", true);
    take(&mut join, &[0], &[0], &[]).expect("in order");
    assert_eq!(join.missing(0), ["class_b"]);
    let mut inputs = Inputs::default();
    inputs.push("class_b", class(0, N_POINTS - 1));
    join.take(&mut inputs).expect("in order");
    let joined = join.next_complete().expect("complete");
    assert!(joined.rows::<ClassTopic>().is_ok_and(|rows| rows.is_some()));
    let error = joined.rows_named::<ClassTopic>("class_b").expect_err("a row is missing").to_string();
    assert_eq!(error, "class_b column of submap 0 has 2 rows for 3 points");
}

#[test]
fn column_that_is_not_expected_is_dropped() {
    let mut join = SubmapJoin::new(Mode::Offline).column::<ClassTopic>(false);
    take(&mut join, &[0], &[0], &[]).expect("in order");
    assert_eq!(complete(&mut join), [(0, None, vec![])]);
}

#[test]
fn lost_column_is_reported_live() {
    let mut join = join(Mode::Live);
    take(&mut join, &[4, 5], &[5], &[4, 5]).expect("numbers may be left out");
    assert_eq!(complete(&mut join), [(4, None, vec!["class"]), (5, Some(5), vec![])]);
    // No later column shows that this one was lost; the number of waiting submaps does.
    take(&mut join, &[6, 7, 8], &[], &[]).expect("in order");
    assert_eq!(complete(&mut join), [(6, None, vec!["class", "color"])]);
    assert_eq!(join.take_oldest().map(|joined| joined.lost), Some(vec!["class", "color"]));
}

#[test]
fn column_without_submap_is_dropped_live() {
    let mut join = join(Mode::Live);
    take(&mut join, &[], &[0, 1, 2], &[0]).expect("in order");
    join.check_bounds().expect("live, old columns are dropped");
    take(&mut join, &[2], &[], &[2]).expect("in order");
    assert_eq!(complete(&mut join), [(2, Some(2), vec![])]);
}

#[test]
fn waiting_messages_survive_save_and_load() {
    let mut before = join(Mode::Offline);
    take(&mut before, &[0, 1], &[0, 1], &[]).expect("in order");
    let mut state = StateBytes::default();
    before.save_messages(&mut state);
    let mut after = join(Mode::Offline);
    after.load(&before.save(), &state.to_vec()).expect("whole");
    take(&mut after, &[], &[], &[0, 1]).expect("in order");
    assert_eq!(complete(&mut after), [(0, Some(0), vec![]), (1, Some(1), vec![])]);
    let longer = [state.to_vec(), vec![0]].concat();
    assert!(join(Mode::Offline).load(&before.save(), &longer).is_err());
    assert!(SubmapJoin::new(Mode::Offline).load(&before.save(), &state.to_vec()).is_err());
}
