CREATE INDEX audit_that_is_open on audit (state, campaign_id, sobol_index)
    where state in ('waiting', 'leased');

CREATE INDEX campaign_case_by_lease on campaign_case (lease_expires_unix_ms)
    where state = 'leased';

CREATE INDEX campaign_case_by_state on campaign_case (campaign_id, state, sobol_index);

CREATE INDEX result_with_contact_loss on result (campaign_id, sobol_index, contact_loss_share)
    where contact_loss_share > 0;

CREATE TABLE attempt (
    campaign_id text not null,
    sobol_index integer not null,
    epoch integer not null,
    worker text not null,
    leased_unix_ms integer,
    ended_unix_ms integer not null,
    ending text not null,
    error text,
    constraint a_lease_ends_once primary key (campaign_id, sobol_index, epoch),
    constraint an_attempt_belongs_to_a_case foreign key (campaign_id, sobol_index)
        references campaign_case (campaign_id, sobol_index),
    -- failed: could not be simulated; lost: the lease expired; returned: handed back;
    -- cancelled: with its campaign; abandoned: found held when a lone coordinator started;
    -- overtaken: an earlier lease's result came after all.
    constraint ending_is_known check (
        ending in ('failed', 'lost', 'returned', 'cancelled', 'abandoned', 'overtaken'))
) strict, without rowid;

CREATE TABLE audit (
    campaign_id text not null,
    sobol_index integer not null,
    -- Whose result is looked at.
    worker text not null,
    state text not null default 'waiting',
    auditor text,
    lease_expires_unix_ms integer,
    -- Largest difference of a band level between the two.
    difference_dB real,
    ended_unix_ms integer,
    constraint a_case_is_audited_once primary key (campaign_id, sobol_index),
    constraint an_audit_belongs_to_a_case foreign key (campaign_id, sobol_index)
        references campaign_case (campaign_id, sobol_index),
    constraint audit_state_is_known check (state in ('waiting', 'leased', 'agrees', 'differs')),
    constraint audit_leased_iff_lease_expires check (
        (state = 'leased') = (lease_expires_unix_ms is not null))
) strict, without rowid;

CREATE TABLE campaign (
    id text not null primary key,
    name text not null,
    -- What decides the cases, and what is done with each; canonical JSON.
    definition text not null,
    definition_hash text not null,
    experiment text not null,
    experiment_hash text not null,
    -- JSON array, ascending.
    speeds_km_h text not null,
    seed integer not null,
    created_at text not null, state text not null default 'running'
    constraint campaign_state_is_known check (state in ('running', 'paused', 'cancelled')), priority integer not null default 0,
    constraint definition_is_json check (json_valid(definition)),
    constraint experiment_is_json check (json_valid(experiment)),
    constraint speeds_are_a_json_array check (json_type(speeds_km_h) = 'array')
) strict;

CREATE TABLE campaign_case (
    campaign_id text not null references campaign (id),
    sobol_index integer not null,
    railpad_stiffness_N_m real not null,
    railpad_damping_N_s_m real not null,
    ballast_stiffness_N_m real not null,
    ballast_damping_N_s_m real not null,
    sleeper_EI_N_m2 real not null,
    irregularity_level real not null,
    surface_seed integer not null,
    parameter_hash text not null,
    state text not null default 'waiting',
    -- Leases given so far. It tells a late report from a current one, so it only grows.
    epoch integer not null default 0,
    -- Leases that ended in a failure or in silence; a lease handed back is not counted.
    attempts integer not null default 0,
    -- Who holds it, or held it last.
    worker text,
    -- By the coordinator's clock.
    lease_expires_unix_ms integer,
    -- How the last counted attempt ended.
    error text, leased_unix_ms integer, drawn text constraint drawn_is_a_json_object check (json_type(drawn) = 'object'),
    constraint a_case_has_one_place_in_its_campaign primary key (campaign_id, sobol_index),
    constraint state_is_known check (state in ('waiting', 'leased', 'finished', 'failed')),
    constraint leased_iff_lease_expires check (
        (state = 'leased') = (lease_expires_unix_ms is not null)),
    constraint leased_to_somebody check (state <> 'leased' or worker is not null),
    constraint failed_for_a_reason check (state <> 'failed' or error is not null)
) strict, without rowid;

CREATE TABLE case_count (
    campaign_id text not null references campaign (id),
    state text not null,
    writer integer not null,
    cases integer not null,
    constraint a_writer_counts_once primary key (campaign_id, state, writer)
) strict, without rowid;

CREATE TABLE diagnosis (
    id text not null primary key,
    recording text not null,
    verdict text not null,
    code_version text not null,
    -- diagnosis.json, whole.
    document text not null,
    created_at text not null,
    constraint diagnosis_document_is_json check (json_valid(document)),
    constraint verdict_is_known check (verdict in (
        'consistent', 'left_out_physics', 'unknown_physics', 'measurement_chain'))
) strict, without rowid;

CREATE TABLE evaluation (
    id text not null primary key,
    -- The recording's name.
    recording text not null,
    method text not null,
    -- What the surrogates were trained on.
    campaign_id text not null references campaign (id),
    library_digest text not null,
    code_version text not null,
    -- evaluation.json, whole.
    document text not null,
    created_at text not null,
    constraint evaluation_document_is_json check (json_valid(document))
) strict, without rowid;

CREATE TABLE frequency_bin (
    experiment_hash text not null,
    -- From 0, ascending.
    bin integer not null,
    frequency_Hz real not null,
    constraint a_bin_has_one_frequency primary key (experiment_hash, bin)
) strict, without rowid;

CREATE TABLE hypothesis (
    diagnosis_id text not null references diagnosis (id),
    -- From 1, the most probable first.
    place integer not null,
    physics text not null,
    -- Of this physics being present.
    probability real not null,
    -- Where; null where it is everywhere or nowhere in particular.
    from_x_m real,
    to_x_m real,
    -- JSON object: name with unit to mean and sd.
    parameters text not null,
    constraint a_hypothesis_has_one_place primary key (diagnosis_id, place),
    constraint hypothesis_parameters_are_json check (json_valid(parameters)),
    constraint probability_is_one check (probability between 0 and 1)
) strict, without rowid;

CREATE TABLE mismatch (
    diagnosis_id text not null references diagnosis (id),
    -- From 1, as in the document.
    place integer not null,
    from_x_m real not null,
    to_x_m real not null,
    from_frequency_Hz real not null,
    to_frequency_Hz real not null,
    level_dB real not null,
    p_value real not null,
    constraint a_mismatch_has_one_place primary key (diagnosis_id, place)
) strict, without rowid;

CREATE TABLE progress (
    campaign_id text not null references campaign (id),
    from_unix_s integer not null,
    writer integer not null,
    finished integer not null,
    failed integer not null,
    busy_s real not null,
    constraint a_writer_tells_once primary key (campaign_id, from_unix_s, writer)
) strict, without rowid;

CREATE TABLE result (
    campaign_id text not null,
    sobol_index integer not null,
    speed_km_h real not null,
    -- ln LWPS, one a frequency bin of the experiment: doubles, big-endian, so that the sqlite3
    -- shell reads bin k with ieee754_from_blob(substr(log_power, 8 * k + 1, 8)).
    log_power blob not null,
    level_50_Hz_dB real not null,
    level_63_Hz_dB real not null,
    level_80_Hz_dB real not null,
    level_100_Hz_dB real not null,
    level_125_Hz_dB real not null,
    level_160_Hz_dB real not null,
    level_200_Hz_dB real not null,
    level_250_Hz_dB real not null,
    level_315_Hz_dB real not null,
    level_400_Hz_dB real not null,
    level_500_Hz_dB real not null,
    level_630_Hz_dB real not null,
    level_800_Hz_dB real not null,
    level_1000_Hz_dB real not null,
    level_1250_Hz_dB real not null,
    level_1600_Hz_dB real not null,
    level_2000_Hz_dB real not null,
    level_2500_Hz_dB real not null,
    level_3150_Hz_dB real not null,
    level_4000_Hz_dB real not null,
    -- Computing time of the case at all speeds together.
    duration_s real not null,
    worker text not null,
    code_version text not null,
    model_hash text not null,
    experiment_hash text not null,
    parameter_hash text not null,
    finished_at text not null, flagged text, contact_loss_share real
    constraint contact_loss_share_is_one check (contact_loss_share between 0 and 1), checksum text,
    constraint a_case_has_one_result_a_speed unique (campaign_id, sobol_index, speed_km_h),
    constraint a_result_belongs_to_a_case foreign key (campaign_id, sobol_index)
        references campaign_case (campaign_id, sobol_index),
    constraint log_power_holds_doubles check (length(log_power) % 8 = 0)
) strict;

CREATE TABLE sleeper_estimate (
    evaluation_id text not null references evaluation (id),
    sleeper text not null,
    x_m real not null,
    railpad_stiffness_N_m real,
    railpad_stiffness_N_m_sd real,
    railpad_damping_N_s_m real,
    railpad_damping_N_s_m_sd real,
    ballast_stiffness_N_m real,
    ballast_stiffness_N_m_sd real,
    ballast_damping_N_s_m real,
    ballast_damping_N_s_m_sd real,
    sleeper_EI_N_m2 real,
    sleeper_EI_N_m2_sd real,
    irregularity_level real,
    irregularity_level_sd real,
    -- What to keep in mind, in a few words; empty if nothing.
    flags text not null,
    constraint a_sleeper_is_estimated_once primary key (evaluation_id, sleeper)
) strict, without rowid;

CREATE TABLE stored_array (
    key text not null primary key,
    kind text not null,
    -- JSON: what they are.
    meta text not null,
    numbers blob not null,
    created_at text not null,
    constraint meta_is_json check (json_valid(meta))
) strict;

CREATE TABLE surrogate (
    training_id text not null references training (id),
    feature text not null,
    -- The speeds it reads together: JSON array, ascending.
    speeds_km_h text not null,
    parameter text not null,
    -- Mean absolute error over the parameter's range (0.05 is 5 %).
    mase_test real not null,
    mase_folds real not null,
    -- Share of the test cases inside their 90 % intervals.
    coverage_90_test real not null,
    constraint a_surrogate_is_trained_once
        primary key (training_id, feature, speeds_km_h, parameter)
) strict, without rowid;

CREATE TABLE training (
    -- Hash of the rest, but for created_at: training again changes nothing.
    id text not null primary key,
    campaign_id text not null references campaign (id),
    -- Digest of the campaign when it was read.
    library_digest text not null,
    -- Cases, those kept for testing included, and what decides which these are.
    cases integer not null,
    seed integer not null,
    code_version text not null,
    created_at text not null
) strict, without rowid;

CREATE TABLE trial (
    -- Seed and hash of the rest, but for created_at: another program's trial is another one.
    id text not null primary key,
    -- Decides what is hidden in which case.
    seed integer not null,
    code_version text not null,
    model_hash text not null,
    created_at text not null
) strict, without rowid;

CREATE TABLE trial_answer (
    trial_id text not null,
    case_number integer not null,
    -- catalogue: with all names; knocked_out: without the hidden one; shuffled: with the sleepers of
    -- each speed in another order; paper: by surrogates and selector.
    question text not null,
    -- Null where the question is not a diagnosis's.
    diagnosis_id text references diagnosis (id),
    -- JSON.
    score text not null,
    worker text not null,
    answered_at text not null,
    constraint a_question_is_answered_once primary key (trial_id, case_number, question),
    constraint an_answer_belongs_to_a_case foreign key (trial_id, case_number)
        references trial_case (trial_id, case_number),
    constraint question_is_known check (
        question in ('catalogue', 'knocked_out', 'shuffled', 'paper')),
    constraint score_is_json check (json_valid(score))
) strict, without rowid;

CREATE TABLE trial_case (
    trial_id text not null references trial (id),
    -- From 0.
    case_number integer not null,
    -- SHA-256 of the file that says what is hidden.
    truth_sha256 text not null,
    constraint a_case_is_sealed_once primary key (trial_id, case_number)
) strict, without rowid;

CREATE TABLE trial_lease (
    trial_id text not null,
    case_number integer not null,
    worker text not null,
    lease_expires_unix_ms integer not null,
    constraint a_trial_case_has_one_lease primary key (trial_id, case_number),
    constraint a_lease_belongs_to_a_trial_case foreign key (trial_id, case_number)
        references trial_case (trial_id, case_number)
) strict, without rowid;

CREATE TABLE worker (
    id text not null primary key,
    code_version text not null,
    model_hash text not null,
    cores integer not null,
    state text not null default 'active',
    -- Why it is in quarantine.
    reason text,
    registered_unix_ms integer not null,
    last_seen_unix_ms integer not null,
    cases_finished integer not null default 0,
    cases_failed integer not null default 0,
    failures_in_a_row integer not null default 0,
    -- Computing time of the finished cases.
    busy_s real not null default 0,
    constraint worker_state_is_known check (state in ('active', 'quarantined')),
    constraint quarantined_for_a_reason check (state = 'active' or reason is not null)
) strict, without rowid;

CREATE TRIGGER count_deleted_case after delete on campaign_case begin
    update case_count set cases = cases - 1
    where campaign_id = old.campaign_id and state = old.state and writer = 0;
end;

CREATE TRIGGER count_inserted_case after insert on campaign_case begin
    insert into case_count (campaign_id, state, writer, cases)
    values (new.campaign_id, new.state, 0, 1)
    on conflict (campaign_id, state, writer) do update set cases = cases + 1;
end;

CREATE TRIGGER count_updated_case after update of state on campaign_case
when old.state <> new.state begin
    update case_count set cases = cases - 1
    where campaign_id = old.campaign_id and state = old.state and writer = 0;
    insert into case_count (campaign_id, state, writer, cases)
    values (new.campaign_id, new.state, 0, 1)
    on conflict (campaign_id, state, writer) do update set cases = cases + 1;
end;

view campaign_progress (campaign_id, from_unix_s, finished, failed, busy_s)

view campaign_status (campaign_id, name, state, priority, cases, waiting, leased, finished, failed, created_at)

view failed_case (campaign_id, sobol_index, railpad_stiffness_N_m, railpad_damping_N_s_m, ballast_stiffness_N_m, ballast_damping_N_s_m, sleeper_EI_N_m2, irregularity_level, surface_seed, attempts, worker, error)

view result_with_parameters (campaign_id, sobol_index, speed_km_h, railpad_stiffness_N_m, railpad_damping_N_s_m, ballast_stiffness_N_m, ballast_damping_N_s_m, sleeper_EI_N_m2, irregularity_level, surface_seed, level_50_Hz_dB, level_63_Hz_dB, level_80_Hz_dB, level_100_Hz_dB, level_125_Hz_dB, level_160_Hz_dB, level_200_Hz_dB, level_250_Hz_dB, level_315_Hz_dB, level_400_Hz_dB, level_500_Hz_dB, level_630_Hz_dB, level_800_Hz_dB, level_1000_Hz_dB, level_1250_Hz_dB, level_1600_Hz_dB, level_2000_Hz_dB, level_2500_Hz_dB, level_3150_Hz_dB, level_4000_Hz_dB, log_power, duration_s, worker, code_version, model_hash, experiment_hash, parameter_hash, finished_at, flagged, contact_loss_share, checksum, drawn)

view spectrum (campaign_id, sobol_index, speed_km_h, bin, frequency_Hz, log_power)
