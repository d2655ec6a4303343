//! Groups of what is alike, directly or through others.

/// Adds `added` to the groups that have one of its like, which become one: no order of the members changes the groups.
pub(super) fn join<T>(groups: &mut Vec<Vec<T>>, is_same: impl Fn(&T) -> bool, added: T) {
    let has_same = |group: &Vec<T>| group.iter().any(&is_same);
    let place = groups.iter().position(has_same).unwrap_or(groups.len());
    let (same, others): (Vec<Vec<T>>, Vec<Vec<T>>) = std::mem::take(groups).into_iter().partition(has_same);
    *groups = others;
    groups.insert(place, same.into_iter().flatten().chain([added]).collect());
}
