-- ## a lease that looks at all: nothing has expired

-- 1
select campaign_id, sobol_index, attempts from campaign_case
where state = 'leased' and lease_expires_unix_ms <= $1
order by lease_expires_unix_ms limit $2 for update skip locked;
--     Limit
--       ->  LockRows
--             ->  Index Scan using campaign_case_by_lease on campaign_case
--                   Index Cond: (lease_expires_unix_ms <= $1)
--                   Filter: (state = 'leased'::text)

-- 2
select id from campaign
where state = 'running'
    and not exists (select 1 from worker where id = $1 and state = 'quarantined')
    and 0 < (select coalesce(sum(cases), 0) from case_count
        where campaign_id = campaign.id and case_count.state = 'waiting')
order by priority desc, created_at, id limit $2;
--     Limit
--       InitPlan 1 (returns $0)
--         ->  Index Scan using worker_pkey on worker
--               Index Cond: (id = $1)
--               Filter: (state = 'quarantined'::text)
--       ->  Sort
--             Sort Key: campaign.priority DESC, campaign.created_at COLLATE "C", campaign.id COLLATE "C"
--             ->  Result
--                   One-Time Filter: (NOT $0)
--                   ->  Seq Scan on campaign
--                         Filter: ((state = 'running'::text) AND ('0'::numeric < (SubPlan 2)))
--                         SubPlan 2
--                           ->  Aggregate
--                                 ->  Index Scan using a_writer_counts_once on case_count
--                                       Index Cond: ((campaign_id = campaign.id) AND (state = 'waiting'::text))

-- 3
select * from campaign_case
where campaign_id = $1 and state = 'waiting' and sobol_index >= $2 and sobol_index < $3
order by sobol_index limit $4 for update skip locked;
--     Limit
--       ->  LockRows
--             ->  Index Scan using campaign_case_waiting on campaign_case
--                   Index Cond: ((campaign_id = $1) AND (sobol_index >= $2) AND (sobol_index < $3))
--                   Filter: (state = 'waiting'::text)

-- 4
update campaign_case set state = 'leased', epoch = epoch + 1, worker = $3, leased_unix_ms = $4,
    lease_expires_unix_ms = $5
where campaign_id = $1 and sobol_index = any($2);
--     Update on campaign_case
--       ->  Index Scan using a_case_has_one_place_in_its_campaign on campaign_case
--             Index Cond: ((campaign_id = $1) AND (sobol_index = ANY ($2)))

-- ## a lease that begins where the last one ended

-- 1: as 2 of "a lease that looks at all: nothing has expired"

-- 2: as 3 of "a lease that looks at all: nothing has expired"

-- 3: as 4 of "a lease that looks at all: nothing has expired"

-- ## a lease that ends expired ones, of a worker in the same process that holds one

-- 1
update campaign_case set lease_expires_unix_ms = $5
where campaign_id = $1 and worker = $2 and state = 'leased'
    and sobol_index = any($3) and ((sobol_index << 32) | epoch) = any($4)
returning sobol_index, epoch;
--     Update on campaign_case
--       ->  Index Scan using campaign_case_by_lease on campaign_case
--             Filter: ((campaign_id = $1) AND (worker = $2) AND (state = 'leased'::text) AND (sobol_index = ANY ($3)) AND (((sobol_index << 32) | epoch) = ANY ($4)))

-- 2: as 1 of "a lease that looks at all: nothing has expired"

-- 3
insert into attempt (campaign_id, sobol_index, epoch, worker, leased_unix_ms, ended_unix_ms, ending, error)
select campaign_id, sobol_index, epoch, worker, leased_unix_ms, $3, $4, $5
from campaign_case where campaign_id = $1 and sobol_index = any($2)
on conflict (campaign_id, sobol_index, epoch) do nothing;
--     Insert on attempt
--       Conflict Resolution: NOTHING
--       Conflict Arbiter Indexes: a_lease_ends_once
--       ->  Index Scan using a_case_has_one_place_in_its_campaign on campaign_case
--             Index Cond: ((campaign_id = $1) AND (sobol_index = ANY ($2)))

-- 4
update campaign_case set state = $3, attempts = $4, error = $5, lease_expires_unix_ms = null
where campaign_id = $1 and sobol_index = any($2);
--     Update on campaign_case
--       ->  Index Scan using a_case_has_one_place_in_its_campaign on campaign_case
--             Index Cond: ((campaign_id = $1) AND (sobol_index = ANY ($2)))

-- 5
select id from campaign
where id = $3 and state = 'running'
    and not exists (select 1 from worker where id = $1 and state = 'quarantined')
    and 0 < (select coalesce(sum(cases), 0) from case_count
        where campaign_id = campaign.id and case_count.state = 'waiting')
order by priority desc, created_at, id limit $2;
--     Limit
--       InitPlan 1 (returns $0)
--         ->  Index Scan using worker_pkey on worker
--               Index Cond: (id = $1)
--               Filter: (state = 'quarantined'::text)
--       ->  Sort
--             Sort Key: campaign.priority DESC, campaign.created_at COLLATE "C"
--             ->  Result
--                   One-Time Filter: (NOT $0)
--                   ->  Index Scan using campaign_pkey on campaign
--                         Index Cond: (id = $3)
--                         Filter: ((state = 'running'::text) AND ('0'::numeric < (SubPlan 2)))
--                         SubPlan 2
--                           ->  Aggregate
--                                 ->  Index Scan using a_writer_counts_once on case_count
--                                       Index Cond: ((campaign_id = campaign.id) AND (state = 'waiting'::text))

-- 6: as 3 of "a lease that looks at all: nothing has expired"

-- 7: as 4 of "a lease that looks at all: nothing has expired"

-- ## a heartbeat: the worker was heard of

-- 1
update worker set last_seen_unix_ms = $2 where id = $1 returning *;
--     Update on worker
--       ->  Index Scan using worker_pkey on worker
--             Index Cond: (id = $1)

-- ## a heartbeat: leases that it names are renewed

-- 1: as 1 of "a lease that ends expired ones, of a worker in the same process that holds one"

-- ## a heartbeat: one of its leases was lost

-- 1: as 1 of "a lease that ends expired ones, of a worker in the same process that holds one"

-- 2
select sobol_index, epoch from campaign_case
where campaign_id = $1 and worker = $2 and state = 'finished'
    and sobol_index = any($3) and ((sobol_index << 32) | epoch) = any($4)
union
select sobol_index, epoch from attempt
where campaign_id = $1 and worker = $2 and ending in ('failed', 'returned')
    and sobol_index = any($3) and ((sobol_index << 32) | epoch) = any($4);
--     Unique
--       ->  Sort
--             Sort Key: campaign_case.sobol_index, campaign_case.epoch
--             ->  Append
--                   ->  Index Scan using a_case_has_one_place_in_its_campaign on campaign_case
--                         Index Cond: ((campaign_id = $1) AND (sobol_index = ANY ($3)))
--                         Filter: ((worker = $2) AND (state = 'finished'::text) AND (((sobol_index << 32) | epoch) = ANY ($4)))
--                   ->  Index Scan using a_lease_ends_once on attempt
--                         Index Cond: (campaign_id = $1)
--                         Filter: ((ending = ANY ('{failed,returned}'::text[])) AND (worker = $2) AND (sobol_index = ANY ($3)) AND (((sobol_index << 32) | epoch) = ANY ($4)))

-- ## cases are handed back

-- 1
insert into attempt (campaign_id, sobol_index, epoch, worker, leased_unix_ms, ended_unix_ms, ending, error)
select campaign_id, sobol_index, epoch, worker, leased_unix_ms, $5, 'returned', null
from campaign_case
where campaign_id = $1 and worker = $2 and state = 'leased'
    and sobol_index = any($3) and ((sobol_index << 32) | epoch) = any($4)
on conflict (campaign_id, sobol_index, epoch) do nothing;
--     Insert on attempt
--       Conflict Resolution: NOTHING
--       Conflict Arbiter Indexes: a_lease_ends_once
--       ->  Index Scan using campaign_case_by_lease on campaign_case
--             Filter: ((campaign_id = $1) AND (worker = $2) AND (sobol_index = ANY ($3)) AND (((sobol_index << 32) | epoch) = ANY ($4)))

-- 2
update campaign_case set state = 'waiting', lease_expires_unix_ms = null
where campaign_id = $1 and worker = $2 and state = 'leased'
    and sobol_index = any($3) and ((sobol_index << 32) | epoch) = any($4);
--     Update on campaign_case
--       ->  Index Scan using campaign_case_by_lease on campaign_case
--             Filter: ((campaign_id = $1) AND (worker = $2) AND (state = 'leased'::text) AND (sobol_index = ANY ($3)) AND (((sobol_index << 32) | epoch) = ANY ($4)))

-- ## a report of a result, drawn for an audit

-- 1
select sobol_index, state, epoch, attempts, worker, parameter_hash from campaign_case
where campaign_id = $1 and sobol_index = any($2) order by sobol_index for update;
--     LockRows
--       ->  Sort
--             Sort Key: sobol_index
--             ->  Index Scan using a_case_has_one_place_in_its_campaign on campaign_case
--                   Index Cond: ((campaign_id = $1) AND (sobol_index = ANY ($2)))

-- 2
update worker set cases_finished = cases_finished + $2, cases_failed = cases_failed + $3, busy_s = busy_s + $4,
    failures_in_a_row = case when $2 > 0 then $5 else failures_in_a_row + $5 end,
    last_seen_unix_ms = case when last_seen_unix_ms < $6 then $6 else last_seen_unix_ms end
where id = $1
returning case when state = 'quarantined' then reason end as quarantine;
--     Update on worker
--       ->  Index Scan using worker_pkey on worker
--             Index Cond: (id = $1)

-- 3
insert into progress (campaign_id, from_unix_s, writer, finished, failed, busy_s)
values ($1, $2, pg_backend_pid(), $3, $4, $5)
on conflict (campaign_id, from_unix_s, writer) do update set
    finished = progress.finished + excluded.finished,
    failed = progress.failed + excluded.failed,
    busy_s = progress.busy_s + excluded.busy_s;
--     Insert on progress
--       Conflict Resolution: UPDATE
--       Conflict Arbiter Indexes: a_writer_tells_once
--       ->  Result

-- 4
with discarded as (
    delete from case_result where campaign_id = $1 and sobol_index = any($2) returning id)
delete from case_series where result_id in (select id from discarded);
--     Delete on case_series
--       CTE discarded
--         ->  Delete on case_result
--               ->  Index Scan using results_of_a_case_are_one_row on case_result
--                     Index Cond: ((campaign_id = $1) AND (sobol_index = ANY ($2)))
--       ->  Nested Loop
--             ->  HashAggregate
--                   Group Key: discarded.id
--                   ->  CTE Scan on discarded
--             ->  Index Scan using a_pass_has_one_series on case_series
--                   Index Cond: (result_id = discarded.id)

-- 5
with given as (
    select sobol_index, duration_s, parameter_hash, checksum, cast(place as integer) as place
    from unnest($8::bigint[], $9::double precision[], $10::text[], $11::text[]) with ordinality
        as of (sobol_index, duration_s, parameter_hash, checksum, place)),
size as (
    select cardinality($7::double precision[]) as passes,
        cardinality($12::double precision[]) / cardinality($8) as levels,
        length($13::bytea) / (cardinality($8) * cardinality($7)) as bytes),
stored as (
    insert into case_result (campaign_id, worker, code_version, model_hash, experiment_hash,
        finished_at, speeds_km_h, sobol_index, duration_s, parameter_hash, checksum, levels_dB,
        contact_loss_shares, flagged)
    select $1, $2, $3, $4, $5, $6, $7, sobol_index, duration_s, parameter_hash, checksum,
        ($12)[levels * (place - 1) + 1:levels * place],
        ($14::double precision[])[passes * (place - 1) + 1:passes * place], $15
    from given, size
    returning id, sobol_index)
insert into case_series (result_id, speed_km_h, log_power)
select id, ($7)[pass],
    substring($13 from bytes * (passes * (place - 1) + pass - 1) + 1 for bytes)
from stored join given using (sobol_index), size, generate_series(1, passes) as pass;
--     Insert on case_series
--       CTE given
--         ->  Function Scan on of
--       CTE size
--         ->  Result
--       CTE stored
--         ->  Insert on case_result
--               ->  Nested Loop
--                     ->  CTE Scan on size size_1
--                     ->  CTE Scan on given given_1
--       ->  Nested Loop
--             ->  Nested Loop
--                   ->  CTE Scan on size
--                   ->  Hash Join
--                         Hash Cond: (stored.sobol_index = given.sobol_index)
--                         ->  CTE Scan on stored
--                         ->  Hash
--                               ->  CTE Scan on given
--             ->  Memoize
--                   Cache Key: size.passes
--                   Cache Mode: binary
--                   ->  Function Scan on generate_series pass

-- 6
update campaign_case set state = 'finished', worker = $2, error = null, lease_expires_unix_ms = null
where campaign_id = $1 and sobol_index = any($3);
--     Update on campaign_case
--       ->  Index Scan using a_case_has_one_place_in_its_campaign on campaign_case
--             Index Cond: ((campaign_id = $1) AND (sobol_index = ANY ($3)))

-- 7
insert into audit (campaign_id, sobol_index, worker)
select campaign_id, sobol_index, $3 from campaign_case
where campaign_id = $1 and sobol_index = any($2)
on conflict (campaign_id, sobol_index) do nothing;
--     Insert on audit
--       Conflict Resolution: NOTHING
--       Conflict Arbiter Indexes: a_case_is_audited_once
--       ->  Index Only Scan using a_case_has_one_place_in_its_campaign on campaign_case
--             Index Cond: ((campaign_id = $1) AND (sobol_index = ANY ($2)))

-- ## a report of a case that could not be simulated

-- 1: as 1 of "a report of a result, drawn for an audit"

-- 2
select count(*) as failures from (
    select ending from attempt
    where campaign_id = $1 and sobol_index = $2 and ending in ('failed', 'lost')
    order by epoch desc limit $3) as counted
where ending = 'failed';
--     Aggregate
--       ->  Subquery Scan on counted
--             Filter: (counted.ending = 'failed'::text)
--             ->  Limit
--                   ->  Index Scan Backward using a_lease_ends_once on attempt
--                         Index Cond: ((campaign_id = $1) AND (sobol_index = $2))
--                         Filter: (ending = ANY ('{failed,lost}'::text[]))

-- 3: as 3 of "a lease that ends expired ones, of a worker in the same process that holds one"

-- 4: as 4 of "a lease that ends expired ones, of a worker in the same process that holds one"

-- 5: as 2 of "a report of a result, drawn for an audit"

-- 6: as 3 of "a report of a result, drawn for an audit"

-- ## a report under an earlier lease, while a later one is held

-- 1: as 1 of "a report of a result, drawn for an audit"

-- 2
select sobol_index, epoch from attempt
where campaign_id = $1 and worker = $2 and sobol_index = any($3);
--     Index Scan using a_lease_ends_once on attempt
--       Index Cond: (campaign_id = $1)
--       Filter: ((worker = $2) AND (sobol_index = ANY ($3)))

-- 3: as 3 of "a lease that ends expired ones, of a worker in the same process that holds one"

-- 4: as 2 of "a report of a result, drawn for an audit"

-- 5: as 3 of "a report of a result, drawn for an audit"

-- 6: as 4 of "a report of a result, drawn for an audit"

-- 7: as 5 of "a report of a result, drawn for an audit"

-- 8: as 6 of "a report of a result, drawn for an audit"

-- ## the same report again

-- 1: as 1 of "a report of a result, drawn for an audit"

-- 2: as 2 of "a report under an earlier lease, while a later one is held"

-- ## an audit is handed out

-- 1
with next as (
    select campaign_id as next_campaign, sobol_index as next_index from audit
    where campaign_id = $1 and worker <> $2
        and (state = 'waiting' or (state = 'leased' and lease_expires_unix_ms <= $3))
        and exists (select 1 from campaign where id = $1 and state = 'running')
    order by sobol_index limit $4 for update skip locked)
update audit set state = 'leased', auditor = $2, lease_expires_unix_ms = $5
from next where campaign_id = next_campaign and sobol_index = next_index
returning sobol_index, worker;
--     Update on audit
--       CTE next
--         ->  Limit
--               InitPlan 1 (returns $0)
--                 ->  Index Scan using campaign_pkey on campaign
--                       Index Cond: (id = $1)
--                       Filter: (state = 'running'::text)
--               ->  LockRows
--                     ->  Result
--                           One-Time Filter: $0
--                           ->  Index Scan using a_case_is_audited_once on audit audit_1
--                                 Index Cond: (campaign_id = $1)
--                                 Filter: ((worker <> $2) AND ((state = 'waiting'::text) OR ((state = 'leased'::text) AND (lease_expires_unix_ms <= $3))))
--       ->  Nested Loop
--             Join Filter: ((audit.campaign_id = next.next_campaign) AND (audit.sobol_index = next.next_index))
--             ->  Index Scan using a_case_is_audited_once on audit
--             ->  CTE Scan on next

-- 2
select * from campaign_case
where campaign_id = $1 and sobol_index = any($2)
order by sobol_index;
--     Sort
--       Sort Key: sobol_index
--       ->  Index Scan using a_case_has_one_place_in_its_campaign on campaign_case
--             Index Cond: ((campaign_id = $1) AND (sobol_index = ANY ($2)))

-- ## a heartbeat: audits that it names are renewed

-- 1
update audit set lease_expires_unix_ms = $4
where campaign_id = $1 and auditor = $2 and state = 'leased' and sobol_index = any($3);
--     Update on audit
--       ->  Index Scan using audit_that_is_open on audit
--             Index Cond: ((state = 'leased'::text) AND (campaign_id = $1))
--             Filter: ((auditor = $2) AND (sobol_index = ANY ($3)))

-- ## an audit is handed back

-- 1
update audit set state = 'waiting', lease_expires_unix_ms = null
where campaign_id = $1 and auditor = $2 and state = 'leased' and sobol_index = any($3);
--     Update on audit
--       ->  Index Scan using audit_that_is_open on audit
--             Index Cond: ((state = 'leased'::text) AND (campaign_id = $1))
--             Filter: ((auditor = $2) AND (sobol_index = ANY ($3)))

-- ## an audit that finds a worker wrong

-- 1
update audit set state = $4, difference_dB = $5, ended_unix_ms = $6, lease_expires_unix_ms = null
where campaign_id = $1 and sobol_index = $2 and auditor = $3 and state = 'leased'
returning worker;
--     Update on audit
--       ->  Index Scan using audit_that_is_open on audit
--             Index Cond: ((state = 'leased'::text) AND (campaign_id = $1) AND (sobol_index = $2))
--             Filter: (auditor = $3)

-- 2
update worker set state = $2, reason = $3, failures_in_a_row = 0 where id = $1;
--     Update on worker
--       ->  Index Scan using worker_pkey on worker
--             Index Cond: (id = $1)

-- 3
select count(*) as results from result where worker = $1 and flagged is null;
--     Aggregate
--       ->  Nested Loop
--             ->  Seq Scan on case_result
--                   Filter: ((flagged IS NULL) AND (worker = $1))
--             ->  Function Scan on unnest of

-- 4
update case_result set flagged = $2 where worker = $1 and flagged is null;
--     Update on case_result
--       ->  Seq Scan on case_result
--             Filter: ((flagged IS NULL) AND (worker = $1))

-- ## a campaign is cancelled: its leases end

-- 1
update campaign set state = $1 where id = $2;
--     Update on campaign
--       ->  Index Scan using campaign_pkey on campaign
--             Index Cond: (id = $2)

-- 2
select sobol_index from campaign_case where campaign_id = $1 and state = 'leased'
order by sobol_index for update;
--     LockRows
--       ->  Sort
--             Sort Key: sobol_index
--             ->  Index Scan using campaign_case_by_lease on campaign_case
--                   Filter: ((campaign_id = $1) AND (state = 'leased'::text))

-- 3: as 3 of "a lease that ends expired ones, of a worker in the same process that holds one"

-- 4
update campaign_case set state = 'waiting', lease_expires_unix_ms = null
where campaign_id = $1 and sobol_index = any($2);
--     Update on campaign_case
--       ->  Index Scan using a_case_has_one_place_in_its_campaign on campaign_case
--             Index Cond: ((campaign_id = $1) AND (sobol_index = ANY ($2)))
