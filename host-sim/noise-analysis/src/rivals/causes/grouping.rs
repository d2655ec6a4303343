//! Groups of what is alike, directly or through others.

/// Adds `added` to the groups that have one of its like, which become one: no order of the members changes the groups.
pub(super) fn join<T>(groups: &mut Vec<Vec<T>>, is_same: impl Fn(&T, &T) -> bool, added: T) {
    let has_same = |group: &Vec<T>| group.iter().any(|known| is_same(known, &added));
    let place = groups.iter().position(has_same).unwrap_or(groups.len());
    let mut joined: Vec<T> = groups.extract_if(place.., |group| has_same(group)).flatten().collect();
    joined.push(added);
    groups.insert(place, joined);
}
