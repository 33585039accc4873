CREATE INDEX audit_that_is_open ON audit USING btree (state, campaign_id, sobol_index) WHERE (state = ANY (ARRAY['waiting'::text, 'leased'::text]));

CREATE INDEX campaign_case_by_lease ON campaign_case USING btree (lease_expires_unix_ms) WHERE (state = 'leased'::text);

CREATE INDEX campaign_case_failed ON campaign_case USING btree (campaign_id, sobol_index) WHERE (state = 'failed'::text);

CREATE INDEX campaign_case_waiting ON campaign_case USING btree (campaign_id, sobol_index) WHERE (state = 'waiting'::text);

CREATE INDEX case_result_with_contact_loss ON case_result USING btree (campaign_id, sobol_index) WHERE ((0)::double precision < ANY (contact_loss_shares));

CREATE TRIGGER count_deleted_case AFTER DELETE ON campaign_case REFERENCING OLD TABLE AS deleted FOR EACH STATEMENT EXECUTE FUNCTION count_cases();

CREATE TRIGGER count_inserted_case AFTER INSERT ON campaign_case REFERENCING NEW TABLE AS inserted FOR EACH STATEMENT EXECUTE FUNCTION count_cases();

CREATE TRIGGER count_updated_case AFTER UPDATE ON campaign_case REFERENCING OLD TABLE AS deleted NEW TABLE AS inserted FOR EACH STATEMENT EXECUTE FUNCTION count_cases();

function count_cases()

function double_at(bytea,bigint)

function doubles(bytea)

table attempt (
    campaign_id text collate "C" not null,
    sobol_index bigint not null,
    epoch bigint not null,
    worker text collate "C" not null,
    leased_unix_ms bigint,
    ended_unix_ms bigint not null,
    ending text collate "C" not null,
    error text collate "C",
    constraint a_lease_ends_once PRIMARY KEY (campaign_id, sobol_index, epoch),
    constraint an_attempt_belongs_to_a_case FOREIGN KEY (campaign_id, sobol_index) REFERENCES campaign_case(campaign_id, sobol_index),
    constraint ending_is_known CHECK ((ending = ANY (ARRAY['failed'::text, 'lost'::text, 'returned'::text, 'cancelled'::text, 'abandoned'::text, 'overtaken'::text])))
);

table audit (
    campaign_id text collate "C" not null,
    sobol_index bigint not null,
    worker text collate "C" not null,
    state text collate "C" not null default 'waiting'::text,
    auditor text collate "C",
    lease_expires_unix_ms bigint,
    difference_db double precision,
    ended_unix_ms bigint,
    constraint a_case_is_audited_once PRIMARY KEY (campaign_id, sobol_index),
    constraint an_audit_belongs_to_a_case FOREIGN KEY (campaign_id, sobol_index) REFERENCES campaign_case(campaign_id, sobol_index),
    constraint audit_leased_iff_lease_expires CHECK (((state = 'leased'::text) = (lease_expires_unix_ms IS NOT NULL))),
    constraint audit_state_is_known CHECK ((state = ANY (ARRAY['waiting'::text, 'leased'::text, 'agrees'::text, 'differs'::text])))
);

table campaign (
    id text collate "C" not null,
    name text collate "C" not null,
    definition text collate "C" not null,
    definition_hash text collate "C" not null,
    experiment text collate "C" not null,
    experiment_hash text collate "C" not null,
    speeds_km_h text collate "C" not null,
    seed bigint not null,
    created_at text collate "C" not null,
    state text collate "C" not null default 'running'::text,
    priority bigint not null default 0,
    constraint campaign_pkey PRIMARY KEY (id),
    constraint campaign_state_is_known CHECK ((state = ANY (ARRAY['running'::text, 'paused'::text, 'cancelled'::text]))),
    constraint definition_is_json CHECK (((definition)::jsonb IS NOT NULL)),
    constraint experiment_is_json CHECK (((experiment)::jsonb IS NOT NULL)),
    constraint speeds_are_a_json_array CHECK ((jsonb_typeof((speeds_km_h)::jsonb) = 'array'::text))
);

table campaign_case (
    campaign_id text collate "C" not null,
    sobol_index bigint not null,
    railpad_stiffness_n_m double precision not null,
    railpad_damping_n_s_m double precision not null,
    ballast_stiffness_n_m double precision not null,
    ballast_damping_n_s_m double precision not null,
    sleeper_ei_n_m2 double precision not null,
    irregularity_level double precision not null,
    surface_seed bigint not null,
    parameter_hash text collate "C" not null,
    state text collate "C" not null default 'waiting'::text,
    epoch bigint not null default 0,
    attempts bigint not null default 0,
    worker text collate "C",
    lease_expires_unix_ms bigint,
    error text collate "C",
    leased_unix_ms bigint,
    drawn text collate "C",
    constraint a_case_has_one_place_in_its_campaign PRIMARY KEY (campaign_id, sobol_index),
    constraint campaign_case_campaign_id_fkey FOREIGN KEY (campaign_id) REFERENCES campaign(id),
    constraint drawn_is_a_json_object CHECK ((json_typeof((drawn)::json) = 'object'::text)),
    constraint failed_for_a_reason CHECK (((state <> 'failed'::text) OR (error IS NOT NULL))),
    constraint leased_iff_lease_expires CHECK (((state = 'leased'::text) = (lease_expires_unix_ms IS NOT NULL))),
    constraint leased_to_somebody CHECK (((state <> 'leased'::text) OR (worker IS NOT NULL))),
    constraint state_is_known CHECK ((state = ANY (ARRAY['waiting'::text, 'leased'::text, 'finished'::text, 'failed'::text])))
) with (fillfactor=70, autovacuum_vacuum_scale_factor=0.02, autovacuum_analyze_scale_factor=0.05);

table case_count (
    campaign_id text collate "C" not null,
    state text collate "C" not null,
    writer bigint not null,
    cases bigint not null,
    constraint a_writer_counts_once PRIMARY KEY (campaign_id, state, writer),
    constraint case_count_campaign_id_fkey FOREIGN KEY (campaign_id) REFERENCES campaign(id)
);

table case_result (
    id bigint generated always as identity not null,
    campaign_id text collate "C" not null,
    sobol_index bigint not null,
    speeds_km_h double precision[] not null,
    levels_db double precision[] not null,
    duration_s double precision not null,
    worker text collate "C" not null,
    code_version text collate "C" not null,
    model_hash text collate "C" not null,
    experiment_hash text collate "C" not null,
    parameter_hash text collate "C" not null,
    finished_at text collate "C" not null,
    flagged text collate "C",
    contact_loss_shares double precision[],
    checksum text collate "C",
    constraint contact_loss_shares_are_ones CHECK ((((0)::double precision <= ALL (contact_loss_shares)) AND ((1)::double precision >= ALL (contact_loss_shares)))),
    constraint every_pass_has_its_contact_loss_share CHECK ((cardinality(contact_loss_shares) = cardinality(speeds_km_h))),
    constraint every_pass_has_its_levels CHECK (((cardinality(speeds_km_h) > 0) AND (cardinality(levels_db) = (20 * cardinality(speeds_km_h))))),
    constraint results_of_a_case_are_one_row PRIMARY KEY (campaign_id, sobol_index)
);

table case_series (
    result_id bigint not null,
    speed_km_h double precision not null,
    log_power bytea not null,
    constraint a_pass_has_one_series PRIMARY KEY (result_id, speed_km_h),
    constraint series_are_doubles CHECK (((length(log_power) % 8) = 0))
) with (toast_tuple_target=8160);

table diagnosis (
    id text collate "C" not null,
    recording text collate "C" not null,
    verdict text collate "C" not null,
    code_version text collate "C" not null,
    document text collate "C" not null,
    created_at text collate "C" not null,
    constraint diagnosis_document_is_json CHECK (((document)::jsonb IS NOT NULL)),
    constraint diagnosis_pkey PRIMARY KEY (id),
    constraint verdict_is_known CHECK ((verdict = ANY (ARRAY['consistent'::text, 'left_out_physics'::text, 'unknown_physics'::text, 'measurement_chain'::text])))
);

table evaluation (
    id text collate "C" not null,
    recording text collate "C" not null,
    method text collate "C" not null,
    campaign_id text collate "C" not null,
    library_digest text collate "C" not null,
    code_version text collate "C" not null,
    document text collate "C" not null,
    created_at text collate "C" not null,
    constraint evaluation_campaign_id_fkey FOREIGN KEY (campaign_id) REFERENCES campaign(id),
    constraint evaluation_document_is_json CHECK (((document)::jsonb IS NOT NULL)),
    constraint evaluation_pkey PRIMARY KEY (id)
);

table frequency_bin (
    experiment_hash text collate "C" not null,
    bin bigint not null,
    frequency_hz double precision not null,
    constraint a_bin_has_one_frequency PRIMARY KEY (experiment_hash, bin)
);

table hypothesis (
    diagnosis_id text collate "C" not null,
    place bigint not null,
    physics text collate "C" not null,
    probability double precision not null,
    from_x_m double precision,
    to_x_m double precision,
    parameters text collate "C" not null,
    constraint a_hypothesis_has_one_place PRIMARY KEY (diagnosis_id, place),
    constraint hypothesis_diagnosis_id_fkey FOREIGN KEY (diagnosis_id) REFERENCES diagnosis(id),
    constraint hypothesis_parameters_are_json CHECK (((parameters)::jsonb IS NOT NULL)),
    constraint probability_is_one CHECK (((probability >= (0)::double precision) AND (probability <= (1)::double precision)))
);

table mismatch (
    diagnosis_id text collate "C" not null,
    place bigint not null,
    from_x_m double precision not null,
    to_x_m double precision not null,
    from_frequency_hz double precision not null,
    to_frequency_hz double precision not null,
    level_db double precision not null,
    p_value double precision not null,
    constraint a_mismatch_has_one_place PRIMARY KEY (diagnosis_id, place),
    constraint mismatch_diagnosis_id_fkey FOREIGN KEY (diagnosis_id) REFERENCES diagnosis(id)
);

table progress (
    campaign_id text collate "C" not null,
    from_unix_s bigint not null,
    writer bigint not null,
    finished bigint not null,
    failed bigint not null,
    busy_s double precision not null,
    constraint a_writer_tells_once PRIMARY KEY (campaign_id, from_unix_s, writer),
    constraint progress_campaign_id_fkey FOREIGN KEY (campaign_id) REFERENCES campaign(id)
);

table sleeper_estimate (
    evaluation_id text collate "C" not null,
    sleeper text collate "C" not null,
    x_m double precision not null,
    railpad_stiffness_n_m double precision,
    railpad_stiffness_n_m_sd double precision,
    railpad_damping_n_s_m double precision,
    railpad_damping_n_s_m_sd double precision,
    ballast_stiffness_n_m double precision,
    ballast_stiffness_n_m_sd double precision,
    ballast_damping_n_s_m double precision,
    ballast_damping_n_s_m_sd double precision,
    sleeper_ei_n_m2 double precision,
    sleeper_ei_n_m2_sd double precision,
    irregularity_level double precision,
    irregularity_level_sd double precision,
    flags text collate "C" not null,
    constraint a_sleeper_is_estimated_once PRIMARY KEY (evaluation_id, sleeper),
    constraint sleeper_estimate_evaluation_id_fkey FOREIGN KEY (evaluation_id) REFERENCES evaluation(id)
);

table stored_array (
    key text collate "C" not null,
    kind text collate "C" not null,
    meta text collate "C" not null,
    numbers bytea not null,
    created_at text collate "C" not null,
    constraint meta_is_json CHECK (((meta)::jsonb IS NOT NULL)),
    constraint stored_array_pkey PRIMARY KEY (key)
);

table surrogate (
    training_id text collate "C" not null,
    feature text collate "C" not null,
    speeds_km_h text collate "C" not null,
    parameter text collate "C" not null,
    mase_test double precision not null,
    mase_folds double precision not null,
    coverage_90_test double precision not null,
    constraint a_surrogate_is_trained_once PRIMARY KEY (training_id, feature, speeds_km_h, parameter),
    constraint surrogate_training_id_fkey FOREIGN KEY (training_id) REFERENCES training(id)
);

table training (
    id text collate "C" not null,
    campaign_id text collate "C" not null,
    library_digest text collate "C" not null,
    cases bigint not null,
    seed bigint not null,
    code_version text collate "C" not null,
    created_at text collate "C" not null,
    constraint training_campaign_id_fkey FOREIGN KEY (campaign_id) REFERENCES campaign(id),
    constraint training_pkey PRIMARY KEY (id)
);

table trial (
    id text collate "C" not null,
    seed bigint not null,
    code_version text collate "C" not null,
    model_hash text collate "C" not null,
    created_at text collate "C" not null,
    constraint trial_pkey PRIMARY KEY (id)
);

table trial_answer (
    trial_id text collate "C" not null,
    case_number bigint not null,
    question text collate "C" not null,
    diagnosis_id text collate "C",
    score text collate "C" not null,
    worker text collate "C" not null,
    answered_at text collate "C" not null,
    constraint a_question_is_answered_once PRIMARY KEY (trial_id, case_number, question),
    constraint an_answer_belongs_to_a_case FOREIGN KEY (trial_id, case_number) REFERENCES trial_case(trial_id, case_number),
    constraint question_is_known CHECK ((question = ANY (ARRAY['catalogue'::text, 'knocked_out'::text, 'shuffled'::text, 'paper'::text]))),
    constraint score_is_json CHECK (((score)::jsonb IS NOT NULL)),
    constraint trial_answer_diagnosis_id_fkey FOREIGN KEY (diagnosis_id) REFERENCES diagnosis(id)
);

table trial_case (
    trial_id text collate "C" not null,
    case_number bigint not null,
    truth_sha256 text collate "C" not null,
    constraint a_case_is_sealed_once PRIMARY KEY (trial_id, case_number),
    constraint trial_case_trial_id_fkey FOREIGN KEY (trial_id) REFERENCES trial(id)
);

table trial_lease (
    trial_id text collate "C" not null,
    case_number bigint not null,
    worker text collate "C" not null,
    lease_expires_unix_ms bigint not null,
    constraint a_lease_belongs_to_a_trial_case FOREIGN KEY (trial_id, case_number) REFERENCES trial_case(trial_id, case_number),
    constraint a_trial_case_has_one_lease PRIMARY KEY (trial_id, case_number)
);

table worker (
    id text collate "C" not null,
    code_version text collate "C" not null,
    model_hash text collate "C" not null,
    cores bigint not null,
    state text collate "C" not null default 'active'::text,
    reason text collate "C",
    registered_unix_ms bigint not null,
    last_seen_unix_ms bigint not null,
    cases_finished bigint not null default 0,
    cases_failed bigint not null default 0,
    failures_in_a_row bigint not null default 0,
    busy_s double precision not null default 0,
    constraint quarantined_for_a_reason CHECK (((state = 'active'::text) OR (reason IS NOT NULL))),
    constraint worker_pkey PRIMARY KEY (id),
    constraint worker_state_is_known CHECK ((state = ANY (ARRAY['active'::text, 'quarantined'::text])))
);

view campaign_progress (campaign_id, from_unix_s, finished, failed, busy_s)

view campaign_status (campaign_id, name, state, priority, cases, waiting, leased, finished, failed, created_at)

view failed_case (campaign_id, sobol_index, railpad_stiffness_n_m, railpad_damping_n_s_m, ballast_stiffness_n_m, ballast_damping_n_s_m, sleeper_ei_n_m2, irregularity_level, surface_seed, attempts, worker, error)

view result (campaign_id, sobol_index, speed_km_h, log_power, level_50_hz_db, level_63_hz_db, level_80_hz_db, level_100_hz_db, level_125_hz_db, level_160_hz_db, level_200_hz_db, level_250_hz_db, level_315_hz_db, level_400_hz_db, level_500_hz_db, level_630_hz_db, level_800_hz_db, level_1000_hz_db, level_1250_hz_db, level_1600_hz_db, level_2000_hz_db, level_2500_hz_db, level_3150_hz_db, level_4000_hz_db, duration_s, worker, code_version, model_hash, experiment_hash, parameter_hash, finished_at, flagged, contact_loss_share, checksum)

view result_with_parameters (campaign_id, sobol_index, speed_km_h, railpad_stiffness_n_m, railpad_damping_n_s_m, ballast_stiffness_n_m, ballast_damping_n_s_m, sleeper_ei_n_m2, irregularity_level, surface_seed, level_50_hz_db, level_63_hz_db, level_80_hz_db, level_100_hz_db, level_125_hz_db, level_160_hz_db, level_200_hz_db, level_250_hz_db, level_315_hz_db, level_400_hz_db, level_500_hz_db, level_630_hz_db, level_800_hz_db, level_1000_hz_db, level_1250_hz_db, level_1600_hz_db, level_2000_hz_db, level_2500_hz_db, level_3150_hz_db, level_4000_hz_db, log_power, duration_s, worker, code_version, model_hash, experiment_hash, parameter_hash, finished_at, flagged, contact_loss_share, checksum, drawn)

view spectrum (campaign_id, sobol_index, speed_km_h, bin, frequency_hz, log_power)
