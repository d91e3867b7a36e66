//! One check and its result.

use serde::Serialize;

/// Result of a check, the worst last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// The rule holds.
    Ok,
    /// Runs work, but may be slow, or fail with larger drives.
    Warning,
    /// Runs fail.
    Problem,
}

impl State {
    /// The word in JSON.
    pub fn word(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Warning => "warning",
            Self::Problem => "problem",
        }
    }
}

/// A check: subject, value found and rule.
#[derive(Debug, PartialEq, Serialize)]
pub struct Check {
    pub subject: &'static str,
    pub state: State,
    /// The value found.
    pub found: String,
    /// The rule that the value must follow.
    pub rule: String,
    /// Remedy; `None` if the rule holds.
    pub advice: Option<String>,
}

impl Check {
    /// A check whose rule holds.
    pub fn ok(subject: &'static str, found: impl Into<String>, rule: impl Into<String>) -> Self {
        Self { subject, state: State::Ok, found: found.into(), rule: rule.into(), advice: None }
    }

    /// The check with a worse state and advice, unless `state` is ok.
    pub fn or(self, state: State, advice: impl FnOnce() -> String) -> Self {
        if state == State::Ok { self } else { Self { state, advice: Some(advice()), ..self } }
    }
}

/// The state of a value that must reach `least` and should reach `good`.
pub fn at_least<T: PartialOrd>(value: &T, least: &T, good: &T) -> State {
    match () {
        () if value < least => State::Problem,
        () if value < good => State::Warning,
        () => State::Ok,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn state_of_a_value_follows_both_limits() {
        assert_eq!([1, 3, 5].map(|value| at_least(&value, &2, &4)), [State::Problem, State::Warning, State::Ok]);
        assert!(State::Problem > State::Warning && State::Warning > State::Ok);
    }

    #[test]
    fn only_findings_have_advice() {
        let check = || Check::ok("disk", "1 GB", "2 GB");
        assert_eq!(check().or(State::Ok, || "make room".to_owned()), check());
        let found = check().or(State::Warning, || "make room".to_owned());
        assert_eq!((found.state, found.advice.as_deref()), (State::Warning, Some("make room")));
    }
}
