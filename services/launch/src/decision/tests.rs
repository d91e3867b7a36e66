//! Tables of every rule of [`judge`], [`restart_stage`] and [`restart_run`].

use super::cause::Cause;
use super::fault::{Counted, Exit, FaultKind};
use super::*;
use run::health::Activity;
use run::health::Activity::{Blocked, Connecting, Done, Draining, Paused, Ready, Saving, Starting, Waiting, Working};
use std::collections::BTreeMap;
use std::time::Duration;

const fn s(seconds: u64) -> Duration {
    Duration::from_secs(seconds)
}

/// The time of observation in all tables.
const NOW: Duration = s(1000);

const fn ago(seconds: u64) -> Duration {
    NOW.saturating_sub(s(seconds))
}

fn policy() -> Policy {
    Policy {
        is_live: false,
        hang_s: 5.0,
        stall_s: 60.0,
        stage_stall_s: BTreeMap::new(),
        restarts: 3,
        restart_delay_s: 0.5,
    }
}

/// A stage that has just sent a heartbeat and made progress.
fn healthy(name: &str, activity: Activity) -> ObservedStage {
    ObservedStage {
        name: name.to_owned(),
        exit: None,
        activity,
        ticks: 23,
        last_heartbeat: NOW,
        last_progress: NOW,
        starved_since_heartbeat: Duration::ZERO,
        starved_since_progress: Duration::ZERO,
        heartbeat_error: None,
        awaits_restart: false,
    }
}

fn exited(name: &str, exit: Exit, activity: Activity) -> ObservedStage {
    ObservedStage { exit: Some(exit), ..healthy(name, activity) }
}

/// A stage without a heartbeat for this many seconds.
fn silent(name: &str, seconds: u64) -> ObservedStage {
    ObservedStage { last_heartbeat: ago(seconds), last_progress: ago(seconds), ..healthy(name, Working) }
}

/// A stage with heartbeats, but without progress for this many seconds.
fn without_progress(name: &str, activity: Activity, seconds: u64) -> ObservedStage {
    ObservedStage { last_progress: ago(seconds), ..healthy(name, activity) }
}

fn topic() -> String {
    "sweep".to_owned()
}

fn judge_now(stages: &[ObservedStage], policy: &Policy) -> Judgment {
    judge(NOW, stages, policy)
}

/// The text of the fault, or the judgment.
fn judged(stages: &[ObservedStage], policy: &Policy) -> String {
    match judge_now(stages, policy) {
        Judgment::Blame(fault) => fault.to_string(),
        other => format!("{other:?}"),
    }
}

fn exit_fault(exit: Exit) -> Fault {
    Fault { stage: "relay".to_owned(), kind: FaultKind::Exit(exit), cause: None }
}

#[test]
fn exited_stage_is_judged_by_its_exit_code() {
    for (exit, activity, expected, may_restart) in [
        (Exit::Code(0), Done, "Finish", true),
        (Exit::Code(0), Working, "[relay] exit: ended with exit code 0 before its work was done", true),
        (Exit::Code(1), Working, "[relay] exit: ended with exit code 1", true),
        (Exit::Code(2), Starting, "[relay] exit: ended with exit code 2", false),
        (Exit::Code(3), Working, "[relay] exit: ended with exit code 3", true),
        (Exit::Code(78), Starting, "[relay] exit: refused its configuration (exit code 78)", false),
        (Exit::Code(101), Working, "[relay] exit: panicked (exit code 101)", true),
        (Exit::Signal(6), Working, "[relay] exit: was killed by SIGABRT: ", true),
        (Exit::Signal(7), Working, "[relay] exit: was killed by SIGBUS: ", true),
        (Exit::Signal(9), Working, "[relay] exit: was killed by SIGKILL: ", true),
        (Exit::Signal(11), Working, "[relay] exit: was killed by SIGSEGV: invalid memory access", true),
        (Exit::Signal(15), Working, "[relay] exit: was killed by signal 15", true),
        // This also applies to a stage that had reported its end.
        (Exit::Code(1), Done, "[relay] exit: ended with exit code 1", true),
    ] {
        let judgment = judge_now(&[exited("relay", exit, activity)], &policy());
        let judged = if let Judgment::Blame(fault) = &judgment { fault.to_string() } else { format!("{judgment:?}") };
        assert!(judged.starts_with(expected), "{exit:?}: {judged}");
        if let Judgment::Blame(fault) = judgment {
            assert_eq!(fault.may_restart(), may_restart, "{exit:?}");
        }
    }
}

#[test]
fn run_finishes_when_all_stages_have_finished() {
    let done = |name| exited(name, Exit::Code(0), Done);
    assert_eq!(judge_now(&[done("source"), done("sink")], &policy()), Judgment::Finish);
    assert_eq!(judge_now(&[done("source"), healthy("sink", Draining)], &policy()), Judgment::Continue);
    let awaits_restart = ObservedStage { awaits_restart: true, ..exited("sink", Exit::Signal(9), Working) };
    let live = Policy { is_live: true, ..policy() };
    assert_eq!(judge_now(&[done("source"), awaits_restart], &live), Judgment::Continue);
}

#[test]
fn stage_without_heartbeat_hangs_after_hang_s() {
    for activity in [Starting, Connecting(topic()), Ready, Waiting(topic()), Working, Blocked(topic()), Saving, Done] {
        let stage = |seconds| ObservedStage { activity: activity.clone(), ..silent("relay", seconds) };
        assert_eq!(judged(&[stage(5)], &policy()), "Continue", "{activity:?}: exactly at the limit");
        assert_eq!(judged(&[stage(6)], &policy()), "[relay] hang: no heartbeat for 6.0 s", "{activity:?}");
    }
}

#[test]
fn time_without_a_processor_counts_neither_as_silence_nor_as_a_stall() {
    let starved = |stage: ObservedStage, seconds| ObservedStage {
        starved_since_heartbeat: s(seconds),
        starved_since_progress: s(seconds),
        ..stage
    };
    assert_eq!(judged(&[starved(silent("relay", 40), 35)], &policy()), "Continue");
    let words = "[relay] hang: no heartbeat for 6.0 s (without 34.0 s in which other programs had the processors)";
    assert_eq!(judged(&[starved(silent("relay", 40), 34)], &policy()), words);
    assert_eq!(judged(&[starved(without_progress("relay", Working, 600), 540)], &policy()), "Continue");
    let words =
        "[relay] stall: 61.0 s (without 539.0 s in which other programs had the processors) in the step of tick 23";
    assert_eq!(judged(&[starved(without_progress("relay", Working, 600), 539)], &policy()), words);
    let waiting = [without_progress("source", Blocked(topic()), 600), without_progress("relay", Waiting(topic()), 100)];
    assert!(judged(&waiting, &policy()).starts_with("[source] stall: no stage has made progress for 100.0 s"));
    assert_eq!(judged(&waiting.map(|stage| starved(stage, 60)), &policy()), "Continue");
}

#[test]
fn first_silent_stage_in_dataflow_order_is_to_blame() {
    let stages = [healthy("source", Blocked(topic())), silent("relay", 6), silent("sink", 30)];
    assert!(judged(&stages, &policy()).starts_with("[relay] hang"));
    // An upstream hang comes before a downstream exit.
    let stages = [silent("source", 6), exited("relay", Exit::Signal(9), Working)];
    assert!(judged(&stages, &policy()).starts_with("[source] hang"));
}

/// The supervisor was blocked after it started to observe at `NOW`, for example by a slow disk: heartbeats that it read
/// late are newer than `NOW`.
#[test]
fn time_the_supervisor_was_blocked_does_not_count() {
    let read_late = ObservedStage { last_heartbeat: NOW + s(30), last_progress: NOW + s(30), ..silent("relay", 0) };
    assert_eq!(judge_now(&[read_late], &policy()), Judgment::Continue);
    let last_seen_before = silent("relay", 4);
    assert_eq!(judge_now(&[last_seen_before], &policy()), Judgment::Continue);
}

#[test]
fn active_stage_without_progress_stalls_after_stall_s() {
    for (activity, expected) in [
        (Working, "[relay] stall: 61.0 s in the step of tick 23"),
        (Starting, "[relay] stall: 61.0 s in its start"),
        (Saving, "[relay] stall: 61.0 s while saving its state"),
        (Connecting(topic()), "[relay] stall: 61.0 s waiting for topic sweep to open"),
    ] {
        assert_eq!(judged(&[without_progress("relay", activity.clone(), 60)], &policy()), "Continue");
        assert_eq!(judged(&[without_progress("relay", activity, 61)], &policy()), expected);
    }
}

#[test]
fn stall_limit_of_the_stage_replaces_that_of_the_run() {
    let own = |seconds: f64| Policy { stage_stall_s: [("relay".to_owned(), seconds)].into(), ..policy() };
    let stages = [without_progress("source", Working, 50), without_progress("relay", Working, 50)];
    assert_eq!(judged(&stages, &policy()), "Continue");
    assert!(judged(&stages, &own(40.0)).starts_with("[relay] stall: 50.0 s"));
    let stages = [healthy("source", Waiting(topic())), without_progress("relay", Working, 70)];
    assert_eq!(judged(&stages, &own(100.0)), "Continue");
}

#[test]
fn waiting_stage_is_not_to_blame_for_another_one() {
    for activity in [Ready, Waiting(topic()), Blocked(topic()), Paused, Draining, Done] {
        let stages = [without_progress("source", activity.clone(), 500), healthy("relay", Working)];
        assert_eq!(judged(&stages, &policy()), "Continue", "{activity:?}");
    }
}

#[test]
fn connecting_stage_is_not_to_blame_while_another_one_starts() {
    let connecting = without_progress("source", Connecting(topic()), 500);
    let starting = |seconds| without_progress("relay", Starting, seconds);
    assert_eq!(judged(&[connecting.clone(), starting(50)], &policy()), "Continue");
    assert!(judged(&[connecting.clone(), starting(61)], &policy()).starts_with("[relay] stall: 61.0 s in its start"));
    // After that the limit counts from the time at which the last of them started to connect.
    let late = |seconds| without_progress("relay", Connecting("class".to_owned()), seconds);
    assert_eq!(judged(&[connecting.clone(), late(10)], &policy()), "Continue");
    assert!(judged(&[connecting, late(61)], &policy()).starts_with("[source] stall: 61.0 s waiting for topic sweep"));
}

#[test]
fn deadlocked_stages_are_reported_after_stall_s() {
    let stages = |seconds| {
        [without_progress("source", Blocked(topic()), 90), without_progress("relay", Waiting(topic()), seconds)]
    };
    assert_eq!(judged(&stages(60), &policy()), "Continue", "the last progress of any stage counts");
    let expected =
        "[source] stall: no stage has made progress for 61.0 s (source: Blocked(\"sweep\"); relay: Waiting(\"sweep\"))";
    assert_eq!(judged(&stages(61), &policy()), expected);
    let live = Policy { is_live: true, ..policy() };
    assert_eq!(judged(&stages(500), &live), "Continue", "live, all may wait for a sensor");
    let [source, relay] = stages(61);
    let finished = exited("acquire", Exit::Code(0), Done);
    assert!(
        judged(&[finished, source, relay], &policy()).starts_with("[source] stall"),
        "a finished stage does not count"
    );
}

#[test]
fn unreadable_heartbeat_is_a_fault_of_its_stage() {
    let unreadable = |stage| ObservedStage { heartbeat_error: Some("gone".to_owned()), ..stage };
    let stages = [unreadable(healthy("source", Working)), exited("relay", Exit::Signal(9), Working)];
    assert!(judged(&stages, &policy()).starts_with("[relay] exit"), "an exit explains more");
    assert_eq!(judged(&stages[..1], &policy()), "[source] heartbeat: cannot be read: gone");
}

#[test]
fn exhausted_resource_decides_whether_a_restart_can_help() {
    let logged = |line: &str| Evidence { log_lines: vec![line.to_owned()], ..Evidence::default() };
    let full = logged("ERROR stage: /out/run/states/3/relay.state: No space left on device (os error 28)");
    for (exit, evidence, expected, may_restart) in [
        (Exit::Code(1), full, "; a disk is full: make room, then continue with --resume (", false),
        (Exit::Code(1), logged("os error 2"), "", true),
        (Exit::Code(1), logged("x (os error 27)"), "; a file reached the largest size allowed (ulimit -f)", false),
        (Exit::Code(1), logged("x (os error 30)"), "; a file system is read-only: make it writable", false),
        (Exit::Code(1), logged("x (os error 122)"), "; a disk quota is exhausted: make room", false),
        (Exit::Signal(7), Evidence::default(), "; an unknown amount free in /dev/shm, this run uses 0.0 MiB", true),
        (Exit::Signal(9), Evidence::default(), "", true),
        (
            Exit::Signal(9),
            Evidence { has_kernel_killed: true, ..Evidence::default() },
            "; the kernel killed it: memory was exhausted",
            true,
        ),
        (Exit::Code(1), Evidence { has_kernel_killed: true, ..Evidence::default() }, "", true),
        (Exit::Signal(25), Evidence::default(), "; raise the limit, then continue with --resume", false),
    ] {
        let mut fault = exit_fault(exit);
        let before = fault.text();
        fault.cause = Cause::from_evidence(fault.signal(), &evidence);
        let added = fault.text();
        let added = added.strip_prefix(&before).expect("the cause is appended");
        assert!(added.starts_with(expected) && (added.is_empty() == expected.is_empty()), "{exit:?}: {added}");
        assert_eq!(fault.may_restart(), may_restart, "{exit:?}: {added}");
    }
    // A stage that stalls because its disk is full.
    let stalled = FaultKind::Stall { stall: Counted { seconds: 61.0, starved_s: 0.0 }, activity: Saving, ticks: 3 };
    let fault = Fault { stage: "relay".to_owned(), kind: stalled, cause: None };
    assert!(Cause::from_evidence(fault.signal(), &logged("x (os error 28)")).is_some());
}

fn failed_attempt(fault: &Fault, barrier: Option<u64>, budget: RestartBudget) -> FailedAttempt<'_> {
    FailedAttempt { fault, is_ending: false, barrier, budget, is_memory_low: false }
}

fn budget(barrier: Option<u64>, used: u32) -> RestartBudget {
    RestartBudget { barrier, used }
}

#[test]
fn offline_fault_ends_the_attempt() {
    let fault = exit_fault(Exit::Signal(9));
    let faulty = FaultyStage { fault: &fault, is_ending: false, restarts: 0, ran_for: None };
    assert_eq!(restart_stage(&faulty, &policy()), StageDecision::EndAttempt);
}

#[test]
fn run_restarts_until_the_budget_is_used() {
    let fault = exit_fault(Exit::Signal(9));
    for (used, delay_ms) in [(0, 500), (1, 1000), (2, 2000)] {
        let decision = restart_run(&failed_attempt(&fault, Some(4), budget(Some(4), used)), &policy());
        let delay = Duration::from_millis(delay_ms);
        assert_eq!(decision, RunDecision::Restart { delay, budget: budget(Some(4), used + 1) });
    }
    let decision = restart_run(&failed_attempt(&fault, Some(4), budget(Some(4), 3)), &policy());
    assert_eq!(decision, RunDecision::GiveUp(GiveUp::NoProgress(3)));
    let never = Policy { restarts: 0, ..policy() };
    assert_eq!(
        restart_run(&failed_attempt(&fault, None, budget(None, 0)), &never),
        RunDecision::GiveUp(GiveUp::NoProgress(0))
    );
}

#[test]
fn new_barrier_resets_the_restart_budget() {
    let fault = exit_fault(Exit::Signal(9));
    for (before, reached, used_after) in [
        (None, None, None),
        (None, Some(1), Some(1)),
        (Some(4), Some(5), Some(1)),
        (Some(4), Some(4), None),
        // The newest barrier was damaged, which is not progress.
        (Some(4), Some(3), None),
    ] {
        let decision = restart_run(&failed_attempt(&fault, reached, budget(before, 3)), &policy());
        let used = if let RunDecision::Restart { budget, .. } = decision { Some(budget.used) } else { None };
        assert_eq!(used, used_after, "{before:?} to {reached:?}");
    }
    let back = restart_run(&failed_attempt(&fault, Some(3), budget(Some(4), 1)), &policy());
    let expected = RunDecision::Restart { delay: s(1), budget: budget(Some(4), 2) };
    assert_eq!(back, expected, "the furthest barrier is kept");
}

#[test]
fn restart_delay_doubles_up_to_thirty_seconds() {
    let fault = exit_fault(Exit::Signal(9));
    let patient = Policy { restarts: 1000, ..policy() };
    for (used, delay) in [(0, 0.5), (3, 4.0), (5, 16.0), (6, 30.0), (31, 30.0), (32, 30.0), (999, 30.0)] {
        let decision = restart_run(&failed_attempt(&fault, None, budget(None, used)), &patient);
        let RunDecision::Restart { delay: got, .. } = decision else { panic!("{decision:?}") };
        assert_eq!(got.as_secs_f64(), delay, "restart {used}");
    }
}

#[test]
fn run_is_given_up_for_one_of_four_reasons() {
    let by_signal = exit_fault(Exit::Signal(9));
    let misconfigured = exit_fault(Exit::Code(78));
    for (fault, is_ending, is_memory_low, used, expected) in [
        (&by_signal, true, false, 0, GiveUp::EndRequested),
        (&by_signal, false, true, 0, GiveUp::MemoryLow),
        (&misconfigured, false, false, 0, GiveUp::RestartCannotHelp),
        (&by_signal, false, false, 3, GiveUp::NoProgress(3)),
        // The reason that matters most to the operator comes first.
        (&misconfigured, true, true, 3, GiveUp::EndRequested),
        (&misconfigured, false, true, 3, GiveUp::MemoryLow),
    ] {
        let attempt = FailedAttempt { fault, is_ending, barrier: None, budget: budget(None, used), is_memory_low };
        assert_eq!(restart_run(&attempt, &policy()), RunDecision::GiveUp(expected));
    }
}

#[test]
fn wrong_configuration_is_never_restarted() {
    for code in [2, 78] {
        let fault = exit_fault(Exit::Code(code));
        let offline = restart_run(&failed_attempt(&fault, Some(9), budget(None, 0)), &policy());
        let live = Policy { is_live: true, ..policy() };
        let faulty = FaultyStage { fault: &fault, is_ending: false, restarts: 0, ran_for: None };
        assert_eq!(offline, RunDecision::GiveUp(GiveUp::RestartCannotHelp));
        assert_eq!(restart_stage(&faulty, &live), StageDecision::GiveUp(GiveUp::RestartCannotHelp));
    }
}

#[test]
fn live_stage_is_restarted_alone_until_its_budget_is_used() {
    let live = Policy { is_live: true, ..policy() };
    let fault = exit_fault(Exit::Signal(9));
    let restart = |n| StageDecision::Restart { delay: Duration::from_millis(500_u64 << (n - 1)), restart: n };
    for (is_ending, restarts, ran_for, expected) in [
        (false, 0, None, restart(1)),
        (false, 1, Some(s(3)), restart(2)),
        (false, 2, Some(s(60)), restart(3)),
        (false, 3, Some(s(3)), StageDecision::GiveUp(GiveUp::NoProgress(3))),
        // A process that ran for more than a minute was healthy.
        (false, 3, Some(s(61)), restart(1)),
        (true, 0, None, StageDecision::GiveUp(GiveUp::EndRequested)),
    ] {
        let faulty = FaultyStage { fault: &fault, is_ending, restarts, ran_for };
        assert_eq!(restart_stage(&faulty, &live), expected, "{restarts} restarts, ran for {ran_for:?}");
    }
}

#[test]
fn live_stage_that_awaits_its_restart_has_no_further_fault() {
    let live = Policy { is_live: true, ..policy() };
    let down = ObservedStage { awaits_restart: true, ..exited("relay", Exit::Signal(9), Working) };
    assert_eq!(judge_now(&[healthy("source", Working), down], &live), Judgment::Continue);
}
