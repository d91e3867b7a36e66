//! Disjoint sets.

/// Disjoint sets, each named by its first member.
pub(crate) struct Sets(pub(crate) Vec<u32>);

impl Sets {
    pub(crate) fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }
    pub(crate) fn find(&mut self, member: usize) -> usize {
        let mut at = member;
        while self.0[at] as usize != at {
            self.0[at] = self.0[self.0[at] as usize];
            at = self.0[at] as usize;
        }
        at
    }
    pub(crate) fn union(&mut self, a: usize, b: usize) {
        let a = self.find(a);
        self.union_firsts(a, b);
    }
    /// Joins the set with first member `first` and the set of `member`. Returns the first member of the union.
    pub(crate) fn union_firsts(&mut self, first: usize, member: usize) -> usize {
        let other = self.find(member);
        let before = first.min(other);
        self.0[first.max(other)] = before as u32;
        before
    }
    /// Number of the set of each member, in the order of first members, and the number of sets.
    pub(crate) fn numbers(&mut self) -> (Vec<u32>, usize) {
        let mut numbers = vec![0; self.0.len()];
        let mut n = 0;
        for member in 0..numbers.len() {
            let first = self.find(member);
            if first == member {
                numbers[member] = n;
                n += 1;
            } else {
                numbers[member] = numbers[first];
            }
        }
        (numbers, n as usize)
    }
}
