-- ## a lease that looks at all: nothing has expired

-- 1
select campaign_id, sobol_index, attempts from campaign_case
where state = 'leased' and lease_expires_unix_ms <= $1
order by lease_expires_unix_ms limit $2;
--     SEARCH campaign_case USING INDEX campaign_case_by_lease (lease_expires_unix_ms<?)

-- 2
select id from campaign
where state = 'running'
    and not exists (select 1 from worker where id = $1 and state = 'quarantined')
    and 0 < (select coalesce(sum(cases), 0) from case_count
        where campaign_id = campaign.id and case_count.state = 'waiting')
order by priority desc, created_at, id limit $2;
--     SCAN campaign
--     SCALAR SUBQUERY 1
--     SEARCH worker USING PRIMARY KEY (id=?)
--     CORRELATED SCALAR SUBQUERY 2
--     SEARCH case_count USING PRIMARY KEY (campaign_id=? AND state=?)
--     USE TEMP B-TREE FOR ORDER BY

-- 3
select * from campaign_case indexed by campaign_case_by_state
where campaign_id = $1 and state = 'waiting' and sobol_index >= $2 and sobol_index < $3
order by sobol_index limit $4;
--     SEARCH campaign_case USING INDEX campaign_case_by_state (campaign_id=? AND state=? AND sobol_index>? AND sobol_index<?)

-- 4
update campaign_case set state = 'leased', epoch = epoch + 1, worker = $3, leased_unix_ms = $4,
    lease_expires_unix_ms = $5
where campaign_id = $1 and sobol_index in (select value from json_each($2));
--     SEARCH campaign_case USING PRIMARY KEY (campaign_id=? AND sobol_index=?)
--     LIST SUBQUERY 1
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER

-- ## a lease that begins where the last one ended

-- 1: as 2 of "a lease that looks at all: nothing has expired"

-- 2: as 3 of "a lease that looks at all: nothing has expired"

-- 3: as 4 of "a lease that looks at all: nothing has expired"

-- ## a lease that ends expired ones, of a worker in the same process that holds one

-- 1
update campaign_case set lease_expires_unix_ms = $5
where campaign_id = $1 and worker = $2 and state = 'leased'
    and sobol_index in (select value from json_each($3))
    and ((sobol_index << 32) | epoch) in (select value from json_each($4))
returning sobol_index, epoch;
--     SEARCH campaign_case USING PRIMARY KEY (campaign_id=? AND sobol_index=?)
--     LIST SUBQUERY 1
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER
--     LIST SUBQUERY 2
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER

-- 2: as 1 of "a lease that looks at all: nothing has expired"

-- 3
insert into attempt (campaign_id, sobol_index, epoch, worker, leased_unix_ms, ended_unix_ms, ending, error)
select campaign_id, sobol_index, epoch, worker, leased_unix_ms, $3, $4, $5
from campaign_case where campaign_id = $1 and sobol_index in (select value from json_each($2))
on conflict (campaign_id, sobol_index, epoch) do nothing;
--     SEARCH campaign_case USING PRIMARY KEY (campaign_id=? AND sobol_index=?)
--     LIST SUBQUERY 1
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER

-- 4
update campaign_case set state = $3, attempts = $4, error = $5, lease_expires_unix_ms = null
where campaign_id = $1 and sobol_index in (select value from json_each($2));
--     SEARCH campaign_case USING PRIMARY KEY (campaign_id=? AND sobol_index=?)
--     LIST SUBQUERY 1
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER

-- 5
select id from campaign
where id = $3 and state = 'running'
    and not exists (select 1 from worker where id = $1 and state = 'quarantined')
    and 0 < (select coalesce(sum(cases), 0) from case_count
        where campaign_id = campaign.id and case_count.state = 'waiting')
order by priority desc, created_at, id limit $2;
--     SEARCH campaign USING INDEX sqlite_autoindex_campaign_1 (id=?)
--     SCALAR SUBQUERY 1
--     SEARCH worker USING PRIMARY KEY (id=?)
--     CORRELATED SCALAR SUBQUERY 2
--     SEARCH case_count USING PRIMARY KEY (campaign_id=? AND state=?)

-- 6: as 3 of "a lease that looks at all: nothing has expired"

-- 7: as 4 of "a lease that looks at all: nothing has expired"

-- ## a heartbeat: the worker was heard of

-- 1
update worker set last_seen_unix_ms = $2 where id = $1 returning *;
--     SEARCH worker USING PRIMARY KEY (id=?)

-- ## a heartbeat: leases that it names are renewed

-- 1: as 1 of "a lease that ends expired ones, of a worker in the same process that holds one"

-- ## a heartbeat: one of its leases was lost

-- 1: as 1 of "a lease that ends expired ones, of a worker in the same process that holds one"

-- 2
select sobol_index, epoch from campaign_case
where campaign_id = $1 and worker = $2 and state = 'finished'
    and sobol_index in (select value from json_each($3))
    and ((sobol_index << 32) | epoch) in (select value from json_each($4))
union
select sobol_index, epoch from attempt
where campaign_id = $1 and worker = $2 and ending in ('failed', 'returned')
    and sobol_index in (select value from json_each($3))
    and ((sobol_index << 32) | epoch) in (select value from json_each($4));
--     COMPOUND QUERY
--     LEFT-MOST SUBQUERY
--     SEARCH campaign_case USING PRIMARY KEY (campaign_id=? AND sobol_index=?)
--     LIST SUBQUERY 1
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER
--     LIST SUBQUERY 2
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER
--     UNION USING TEMP B-TREE
--     SEARCH attempt USING PRIMARY KEY (campaign_id=? AND sobol_index=?)
--     LIST SUBQUERY 4
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER
--     LIST SUBQUERY 5
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER

-- ## cases are handed back

-- 1
insert into attempt (campaign_id, sobol_index, epoch, worker, leased_unix_ms, ended_unix_ms, ending, error)
select campaign_id, sobol_index, epoch, worker, leased_unix_ms, $5, 'returned', null
from campaign_case
where campaign_id = $1 and worker = $2 and state = 'leased'
    and sobol_index in (select value from json_each($3))
    and ((sobol_index << 32) | epoch) in (select value from json_each($4))
on conflict (campaign_id, sobol_index, epoch) do nothing;
--     SEARCH campaign_case USING PRIMARY KEY (campaign_id=? AND sobol_index=?)
--     LIST SUBQUERY 1
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER
--     LIST SUBQUERY 2
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER

-- 2
update campaign_case set state = 'waiting', lease_expires_unix_ms = null
where campaign_id = $1 and worker = $2 and state = 'leased'
    and sobol_index in (select value from json_each($3))
    and ((sobol_index << 32) | epoch) in (select value from json_each($4));
--     SEARCH campaign_case USING PRIMARY KEY (campaign_id=? AND sobol_index=?)
--     LIST SUBQUERY 1
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER
--     LIST SUBQUERY 2
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER

-- ## a report of a result, drawn for an audit

-- 1
select sobol_index, state, epoch, attempts, worker, parameter_hash from campaign_case
where campaign_id = $1 and sobol_index in (select value from json_each($2)) order by sobol_index;
--     SEARCH campaign_case USING PRIMARY KEY (campaign_id=? AND sobol_index=?)
--     LIST SUBQUERY 1
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER

-- 2
update worker set cases_finished = cases_finished + $2, cases_failed = cases_failed + $3, busy_s = busy_s + $4,
    failures_in_a_row = case when $2 > 0 then $5 else failures_in_a_row + $5 end,
    last_seen_unix_ms = case when last_seen_unix_ms < $6 then $6 else last_seen_unix_ms end
where id = $1
returning case when state = 'quarantined' then reason end as quarantine;
--     SEARCH worker USING PRIMARY KEY (id=?)

-- 3
insert into progress (campaign_id, from_unix_s, writer, finished, failed, busy_s)
values ($1, $2, 0, $3, $4, $5)
on conflict (campaign_id, from_unix_s, writer) do update set
    finished = progress.finished + excluded.finished,
    failed = progress.failed + excluded.failed,
    busy_s = progress.busy_s + excluded.busy_s;

-- 4
delete from result where campaign_id = $1 and sobol_index in (select value from json_each($2));
--     SEARCH result USING COVERING INDEX sqlite_autoindex_result_1 (campaign_id=? AND sobol_index=?)
--     LIST SUBQUERY 1
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER

-- 5
insert into result (campaign_id, worker, code_version, model_hash,
    experiment_hash, finished_at, flagged, sobol_index, speed_km_h, duration_s, parameter_hash, checksum,
    contact_loss_share, log_power, level_50_Hz_dB, level_63_Hz_dB, level_80_Hz_dB, level_100_Hz_dB, level_125_Hz_dB, level_160_Hz_dB, level_200_Hz_dB, level_250_Hz_dB, level_315_Hz_dB, level_400_Hz_dB, level_500_Hz_dB, level_630_Hz_dB, level_800_Hz_dB, level_1000_Hz_dB, level_1250_Hz_dB, level_1600_Hz_dB, level_2000_Hz_dB, level_2500_Hz_dB, level_3150_Hz_dB, level_4000_Hz_dB) values ($55, $56, $57, $58, $59, $60, $61, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?), ($55, $56, $57, $58, $59, $60, $61, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?);
--     SCAN 2-ROW VALUES CLAUSE

-- 6
update campaign_case set state = 'finished', worker = $2, error = null, lease_expires_unix_ms = null
where campaign_id = $1 and sobol_index in (select value from json_each($3));
--     SEARCH campaign_case USING PRIMARY KEY (campaign_id=? AND sobol_index=?)
--     LIST SUBQUERY 1
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER

-- 7
insert into audit (campaign_id, sobol_index, worker)
select campaign_id, sobol_index, $3 from campaign_case
where campaign_id = $1 and sobol_index in (select value from json_each($2))
on conflict (campaign_id, sobol_index) do nothing;
--     SEARCH campaign_case USING PRIMARY KEY (campaign_id=? AND sobol_index=?)
--     LIST SUBQUERY 1
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER

-- ## a report of a case that could not be simulated

-- 1: as 1 of "a report of a result, drawn for an audit"

-- 2
select count(*) as failures from (
    select ending from attempt
    where campaign_id = $1 and sobol_index = $2 and ending in ('failed', 'lost')
    order by epoch desc limit $3) as counted
where ending = 'failed';
--     CO-ROUTINE counted
--     SEARCH attempt USING PRIMARY KEY (campaign_id=? AND sobol_index=?)
--     SCAN counted

-- 3: as 3 of "a lease that ends expired ones, of a worker in the same process that holds one"

-- 4: as 4 of "a lease that ends expired ones, of a worker in the same process that holds one"

-- 5: as 2 of "a report of a result, drawn for an audit"

-- 6: as 3 of "a report of a result, drawn for an audit"

-- ## a report under an earlier lease, while a later one is held

-- 1: as 1 of "a report of a result, drawn for an audit"

-- 2
select sobol_index, epoch from attempt
where campaign_id = $1 and worker = $2 and sobol_index in (select value from json_each($3));
--     SEARCH attempt USING PRIMARY KEY (campaign_id=? AND sobol_index=?)
--     LIST SUBQUERY 1
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER

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
    order by sobol_index limit $4)
update audit set state = 'leased', auditor = $2, lease_expires_unix_ms = $5
from next where campaign_id = next_campaign and sobol_index = next_index
returning sobol_index, worker;
--     MATERIALIZE next
--     SEARCH audit USING PRIMARY KEY (campaign_id=?)
--     SEARCH campaign EXISTS USING INDEX sqlite_autoindex_campaign_1 (id=?)
--     SCAN next
--     SEARCH audit USING PRIMARY KEY (campaign_id=? AND sobol_index=?)

-- 2
select * from campaign_case
where campaign_id = $1 and sobol_index in (select value from json_each($2))
order by sobol_index;
--     SEARCH campaign_case USING PRIMARY KEY (campaign_id=? AND sobol_index=?)
--     LIST SUBQUERY 1
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER

-- ## a heartbeat: audits that it names are renewed

-- 1
update audit set lease_expires_unix_ms = $4
where campaign_id = $1 and auditor = $2 and state = 'leased'
    and sobol_index in (select value from json_each($3));
--     SEARCH audit USING PRIMARY KEY (campaign_id=? AND sobol_index=?)
--     LIST SUBQUERY 1
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER

-- ## an audit is handed back

-- 1
update audit set state = 'waiting', lease_expires_unix_ms = null
where campaign_id = $1 and auditor = $2 and state = 'leased'
    and sobol_index in (select value from json_each($3));
--     SEARCH audit USING PRIMARY KEY (campaign_id=? AND sobol_index=?)
--     LIST SUBQUERY 1
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER

-- ## an audit that finds a worker wrong

-- 1
update audit set state = $4, difference_dB = $5, ended_unix_ms = $6, lease_expires_unix_ms = null
where campaign_id = $1 and sobol_index = $2 and auditor = $3 and state = 'leased'
returning worker;
--     SEARCH audit USING PRIMARY KEY (campaign_id=? AND sobol_index=?)

-- 2
update worker set state = $2, reason = $3, failures_in_a_row = 0 where id = $1;
--     SEARCH worker USING PRIMARY KEY (id=?)

-- 3
select count(*) as results from result where worker = $1 and flagged is null;
--     SCAN result

-- 4
update result set flagged = $2 where worker = $1 and flagged is null;
--     SCAN result

-- ## a campaign is cancelled: its leases end

-- 1
update campaign set state = $1 where id = $2;
--     SEARCH campaign USING INDEX sqlite_autoindex_campaign_1 (id=?)

-- 2
select sobol_index from campaign_case where campaign_id = $1 and state = 'leased'
order by sobol_index;
--     SEARCH campaign_case USING COVERING INDEX campaign_case_by_state (campaign_id=? AND state=?)

-- 3: as 3 of "a lease that ends expired ones, of a worker in the same process that holds one"

-- 4
update campaign_case set state = 'waiting', lease_expires_unix_ms = null
where campaign_id = $1 and sobol_index in (select value from json_each($2));
--     SEARCH campaign_case USING PRIMARY KEY (campaign_id=? AND sobol_index=?)
--     LIST SUBQUERY 1
--     SCAN json_each VIRTUAL TABLE INDEX 1:
--     CREATE BLOOM FILTER
