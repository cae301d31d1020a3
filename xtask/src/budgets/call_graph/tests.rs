//! Stack depth along hand-made call graphs.

use super::*;

fn program(functions: &[(u32, u32, &[u32])]) -> CallGraph {
    let functions = functions.iter().map(|(at, frame, calls)| {
        let calls = calls.iter().copied().collect();
        (*at, LinkedFunction { name: format!("f{at}"), frame: *frame, calls, ..LinkedFunction::default() })
    });
    CallGraph { functions: functions.collect(), rules: &[], diverging: &[], callbacks: &[] }
}

#[test]
fn depth_is_the_deepest_path() {
    let p = program(&[(0, 8, &[10, 20]), (10, 100, &[]), (20, 16, &[30]), (30, 96, &[])]);
    assert_eq!(p.depth_of("f0").unwrap(), 8 + 16 + 96);
}

#[test]
fn recursion_and_unknown_targets_are_errors() {
    let p = program(&[(0, 8, &[10]), (10, 8, &[0]), (20, 8, &[99])]);
    assert!(p.depth_of("f0").unwrap_err().root_cause().to_string().contains("calls itself"));
    assert!(p.depth_of("f20").unwrap_err().root_cause().to_string().contains("no known function"));
}

#[test]
fn calls_through_registers_need_a_rule_with_existing_targets() {
    let mut p = program(&[(0, 8, &[]), (10, 100, &[]), (20, 50, &[])]);
    p.functions.get_mut(&0).unwrap().indirect = true;
    assert!(p.depth_of("f0").unwrap_err().root_cause().to_string().contains("through a register"));
    p.rules = &[CallRule { callers: &["f0"], callees: &[Callee::Named("f1"), Callee::Named("f2")] }];
    assert_eq!(p.depth_of("f0").unwrap(), 108);
    p.diverging = &["f10"];
    assert_eq!(p.depth_of("f0").unwrap(), 58);
    p.rules = &[CallRule { callers: &["f0"], callees: &[Callee::Calling("f", "f20")] }];
    assert!(p.depth_of("f0").is_err(), "no function calls f20");
    p.functions.get_mut(&10).unwrap().calls.insert(20);
    p.diverging = &[];
    assert_eq!(p.depth_of("f0").unwrap(), 158);
    p.rules = &[CallRule { callers: &["f0"], callees: &[Callee::Named("gone")] }];
    assert!(p.depth_of("f0").unwrap_err().root_cause().to_string().contains("gone"));
}

#[test]
fn function_addresses_among_constants_count_as_called_except_callbacks() {
    let mut p = program(&[(0, 8, &[]), (10, 100, &[]), (20, 50, &[])]);
    p.functions.get_mut(&0).unwrap().literals = BTreeSet::from([10, 20, 99]);
    assert_eq!(p.depth_of("f0").unwrap(), 8, "constants of a function that makes no such calls are data");
    p.functions.get_mut(&0).unwrap().indirect = true;
    assert_eq!(p.depth_of("f0").unwrap(), 108, "a constant that is no function's address is data");
    p.callbacks = &["f10"];
    assert_eq!(p.depth_of("f0").unwrap(), 58);
    // A call from memory needs a rule, whose target is added.
    p.rules = &[CallRule { callers: &["f0"], callees: &[Callee::Named("f10")] }];
    assert_eq!(p.depth_of("f0").unwrap(), 108);
    p.rules = &[];
    p.callbacks = &["f"];
    assert!(p.depth_of("f0").unwrap_err().root_cause().to_string().contains("through a register"));
}

#[test]
fn the_deepest_call_path_lists_each_function_with_its_frame() {
    let p = program(&[(0, 8, &[10, 20]), (10, 100, &[]), (20, 16, &[30]), (30, 96, &[])]);
    assert_eq!(p.call_path("f0", None).unwrap(), [("f0", 8), ("f20", 16), ("f30", 96)]);
    assert_eq!(p.largest(2), [("f10", 100), ("f30", 96)]);
}

#[test]
fn a_function_is_found_by_its_name_or_by_a_part_that_no_other_has() {
    let mut p = program(&[(1, 8, &[]), (10, 100, &[]), (20, 50, &[])]);
    assert_eq!(p.depth_of("f1").unwrap(), 8, "the full name comes first");
    assert_eq!(p.depth_of("20").unwrap(), 50);
    p.functions.get_mut(&20).unwrap().name = "f101".to_owned();
    assert!(p.depth_of("10").is_err(), "two have it");
    assert!(p.depth_of("f2").is_err());
}

#[test]
fn a_function_is_read_from_its_code_and_not_from_its_literals() {
    // push {r7, lr}; bl 0x200; pop {r7, pc}; then a literal that would read as `sub sp, #508`.
    let halves = [0xb580_u16, 0xf000, 0xf87d, 0xbd80, 0xb0ff, 0xb0ff];
    let body: Vec<u8> = halves.iter().flat_map(|half| half.to_le_bytes()).collect();
    let function = LinkedFunction::of("f".to_owned(), 0x100, &body, |address| address < 0x108);
    assert_eq!(function.frame, 8);
    assert_eq!(function.calls, BTreeSet::from([0x200]));
}
